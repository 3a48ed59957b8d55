"""What a page is made of, and how it is written as HTML, Markdown, JSON and on a terminal."""
