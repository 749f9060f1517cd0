"""Files for papers: LaTeX compiles them, names are escaped, and every method has its source."""

import dataclasses
import re
import shutil
import subprocess
import unicodedata

import numpy as np
import pytest
from repository import REPOSITORY
from scores import SCORE, track

from twin.estimation.methods import METHODS
from twin.evaluation.paper import TABLES
from twin.files.assets import assets_folder
from twin.report.publication import NAMES, bibliography, latex_tables, methods_of, write_publication

NAME = "50 % & [a]_x^2 {~} #1 $"
PAPER = r"""\documentclass[twocolumn]{article}
\usepackage[margin=0.65in,columnsep=0.2in]{geometry}
\usepackage{booktabs,graphicx}
\begin{document}
\cite{kalman1960}
\input{tables}
\begin{figure}\includegraphics{rmse_column.pdf}\end{figure}
\begin{figure*}\includegraphics{rmse.pdf}\end{figure*}
\begin{figure}\includegraphics{figure_06_column.pdf}\end{figure}
\begin{figure*}\includegraphics{figure_06.pdf}\end{figure*}
\bibliographystyle{plain}\bibliography{methods}
\end{document}
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The files of a comparison with a method whose name is full of LaTeX's special characters."""
    folder = tmp_path_factory.mktemp("paper")
    conditions = [(table.noise, level) for table in TABLES for level in table.values]
    scores = [
        dataclasses.replace(SCORE, noise=noise, level=level, method=method, paper_rmse_deg=2.0)
        for noise, level in (*conditions, ("salt-and-pepper", 0.05))
        for method in (NAME, "AM", "RAM", "RAM (twins), filter alone")
    ]
    time = np.arange(0, 20, 0.1)
    truth = 20 * np.sin(time)
    tracks = {("gaussian", 1.0): track(time, truth, truth, {"AM": truth, "RAM": truth})}
    write_publication(folder, scores, tracks, [], ["pdf"])
    return folder


def test_figures_are_in_the_format_and_the_widths_of_a_paper(results):
    drawn = {path.name: path.read_bytes() for path in results.iterdir() if path.suffix in (".pdf", ".png")}
    assert {"rmse.pdf", "rmse_column.pdf", "figure_06.pdf", "figure_06_column.pdf"} < drawn.keys() < {*NAMES}
    assert all(content.startswith(b"%PDF-") for content in drawn.values())
    for name, content in drawn.items():
        width = float(re.search(rb"MediaBox \[ 0 0 ([\d.]+)", content)[1]) / 72
        assert width == pytest.approx(3.5 if "_column" in name else 7.2)


def test_latex_takes_tables_figures_and_sources(results, tmp_path):
    latex = shutil.which("pdflatex") or shutil.which("tectonic")
    if latex is None:
        pytest.skip("no LaTeX: apt-get install texlive-latex-recommended")
    for name in ("tables.tex", "methods.bib", *(path.name for path in results.glob("*.pdf"))):
        shutil.copy(results / name, tmp_path)
    (tmp_path / "paper.tex").write_text(PAPER)
    once = [latex, *(["-interaction=nonstopmode", "-halt-on-error"] if "pdf" in latex else []), "paper.tex"]
    for command in [once, ["bibtex", "paper"], once] if "pdf" in latex else [once]:
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout[-2000:]
    if "pdf" in latex:
        assert "Overfull" not in (tmp_path / "paper.log").read_text()
        assert "A new approach to linear filtering" in (tmp_path / "paper.bbl").read_text()
    assert (tmp_path / "paper.pdf").stat().st_size > 10_000


def test_names_are_escaped_the_best_is_bold_and_the_papers_figure_follows(results):
    assert (
        r"50 \% \& {[}a]\_x\textasciicircum{}2 \{\textasciitilde{}\} \#1 \$ & "
        in (results / "tables.tex").read_text()
    )
    scores = [
        dataclasses.replace(SCORE, method="RAM", rmse_deg=0.7, paper_rmse_deg=0.6354, is_best=True),
        dataclasses.replace(SCORE, method="AM", rmse_deg=2.0),
        dataclasses.replace(SCORE, method="RAM (oracle)", oracle=True, rmse_deg=0.1),
    ]
    first, gaussian = latex_tables(scores).split(r"\begin{table*}")[1:]
    assert r"RAM & \textbf{0.70} (0.64) \\" in first
    assert re.search(r"AM & 2.00 .*\n.*RAM & .*\n\\midrule\nRAM \(oracle\) & 0.10 ", first)
    assert r"RAM & 0.500 & \textbf{0.700} & 0.400 & 0.200 \\" in gaussian
    level = [dataclasses.replace(of, is_best=False) for of in scores]
    assert "textbf" not in latex_tables(level)  # as in Markdown and on the pages: another may be as good


def test_every_method_has_a_source_and_only_those_in_use_are_written():
    entries = re.split(r"\n(?=@)", (assets_folder() / "methods.bib").read_text())[1:]
    named = set().union(*map(methods_of, entries))
    assert named == METHODS.keys() - {"Own agent"}
    keys = [re.match(r"@\w+\{(\w+),", entry)[1] for entry in entries]
    assert len(keys) == len({*keys})
    for key, entry in zip(keys, entries, strict=True):
        surname, year = re.match(r"([a-z]+)(\d*)", key).groups()
        if year:
            assert f"year = {{{year}}}" in entry
            assert plain(re.search(r"author = \{(.*?),", entry)[1]) == surname
    written = bibliography(["C-H", "Huber"])
    assert re.findall(r"@\w+\{(\w+),", written) == ["endotwin", "coleman1986", "huber1964", "karlgaard2015"]


def test_the_sources_are_those_of_the_table_of_methods_in_the_documents():
    entries = re.split(r"\n(?=@)", (assets_folder() / "methods.bib").read_text())[1:]
    methods = {re.match(r"@\w+\{(\w+),", entry)[1]: methods_of(entry) for entry in entries}
    rows = [line.split("|") for line in (REPOSITORY / "docs/method.md").read_text().splitlines()]
    stated = [(row[1], row[5]) for row in rows if len(row) == 8 and re.search(r"\d{4}", row[5])]
    assert len(stated) > 15
    for names, sources in stated:
        compared = {name for name in METHODS if re.search(rf"(^|, ){re.escape(name)}(,|$)", names.strip())}
        for author, year in re.findall(r"(?:^|, |; )([A-Z][\w'-]+)[^,;]*? (\d{4})", sources.strip()):
            assert methods[plain(author) + year] & compared, (names, author)


def plain(name: str) -> str:
    """A surname in small letters of ASCII, without the accents of LaTeX or Unicode."""
    return re.sub("[^a-z]", "", unicodedata.normalize("NFKD", name).lower())
