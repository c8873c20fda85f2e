"""The real thing, small: videos of a script in, a policy out that imitates it. No simulator, no reward given.

The whole method runs as in Algorithm 1 on the drawn task. The policy must come far closer to its target than what
cannot have learned from the videos: random actions, an agent that is never updated, an agent on shuffled rewards.
"""
