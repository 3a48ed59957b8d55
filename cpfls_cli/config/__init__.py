"""Study configs: one YAML file, validated as a whole."""
