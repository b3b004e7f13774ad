"""The typed configuration and its YAML files."""
