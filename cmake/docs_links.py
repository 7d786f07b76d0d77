"""Hook of mkdocs: what a page links to outside of docs/ is a file of the source, which the site does not have."""
import re


def on_page_markdown(markdown, page, config, files):
    outside = r"\[([^\]]*)\]\((?:\.\./)+(?!measurements|images|[a-z-]+\.md)([^)#]*)(?:#[^)]*)?\)"
    return re.sub(outside, r"\1 (`\2`)", markdown)
