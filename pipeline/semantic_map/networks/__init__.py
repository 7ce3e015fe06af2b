"""The point network: Wang et al., "Dynamic Graph CNN for Learning on Point Clouds" (ACM TOG 2019)."""
