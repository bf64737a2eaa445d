"""Read an extract: elements as records, and what their tags say."""
