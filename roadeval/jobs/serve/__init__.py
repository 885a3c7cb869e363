"""Results served as pages."""
