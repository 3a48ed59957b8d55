"""What a person reads about each artifact: a sentence, a table and a figure stand once."""
