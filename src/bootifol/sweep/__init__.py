"""Many runs under equal terms: a file that says which, and Ray, which runs them on one machine or on several."""
