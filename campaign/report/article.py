"""Writing an article: page, JSON, tables, figures, other formats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from itertools import chain
from pathlib import Path

from campaign.report.drawing.pdf import also_as_pdf
from campaign.report.formats.as_json import article_json
from campaign.report.formats.interface import Format, WrittenPage
from campaign.report.output import refuse_other, replaced_folder, write_files
from campaign.report.page.article import Article
from campaign.report.page.names import slug
from campaign.report.page.templates import Templates
from campaign.report.palette import variables


def write_article(
    name: str,
    make: Callable[[], Article],
    output: Path,
    packaged_templates: Path,
    templates: Path | None = None,
    formats: Sequence[Format] = (),
) -> Path:
    """Write the article that `make` returns into the folder `output`; return the page's path.

    name: stem of the article's files. `templates` and `formats`: as for a report. The same archives
    result in the same bytes. Raises UsageError when `output` has another page of campaign, or
    cannot be written.
    """
    page = f"{name}.html"
    refuse_other(output, page)
    filled = Templates(packaged_templates, templates)
    with also_as_pdf() if any(each.pdf_figures for each in formats) else nullcontext():
        article = make()
    files = {page: article_html(article, filled), f"{name}.json": article_json(article)}
    with replaced_folder(output) as new:
        write_files(new, chain(files.items(), article.folder.files.items()))
        pieces, pdfs = tuple(article.pieces()), article.folder.pdfs
        for each in formats:
            each.write(WrittenPage(name, slug(article.title), pieces, new, pdfs))
    return output / page


def article_html(article: Article, templates: Templates) -> str:
    """HTML text of the page."""
    return templates.fill("article.html", {"article": article, "colours": variables()})
