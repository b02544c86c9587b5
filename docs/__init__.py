"""The pages, the helpers of their build, and the engines for browsers (`docs.web`)."""
