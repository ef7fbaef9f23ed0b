"""Every paper that the code cites is in docs/references.bib."""

import re
import unicodedata

CITATION = re.compile(r"\[([A-Z]\w+)(?: & ([A-Z]\w+)| et al\.)?,? ((?:19|20)\d\d)\b")


def entries(root) -> set[tuple[str, str]]:
    """(first author's family name, year) of each entry, accents dropped."""
    text = re.sub(r"\\.", "", (root / "docs/references.bib").read_text()).replace("{", "").replace("}", "")
    authors, years = re.findall(r"author = ([^,]+?),", text), re.findall(r"year = (\d{4})", text)
    assert len(authors) == len(years) > 20
    return {(plain(author), year) for author, year in zip(authors, years, strict=True)}


def plain(name: str) -> str:
    decomposed = unicodedata.normalize("NFD", name.split()[0])
    return "".join(c for c in decomposed if not unicodedata.combining(c))


def test_citations_are_in_the_bibliography(root):
    known = entries(root)
    files = [p for folder in ("native/src", "gi_engine", "tests", "docs") for p in (root / folder).rglob("*")]
    missing = set()
    for path in files:
        if path.suffix in (".h", ".cpp", ".py", ".md"):
            for first, _, year in CITATION.findall(path.read_text()):
                if (plain(first), year) not in known:
                    missing.add(f"[{first} {year}] in {path.relative_to(root)}")
    assert not missing, "\n".join(sorted(missing))


def test_citations_are_seen():
    """The pattern reads the forms in use."""
    forms = "[Kajiya 1986] [Veach 1997, eq. 9.13] [Born & Wolf 1999, §14] [Heitz et al. 2016] [Wächter & Binder 2019, ch. 6]"
    assert [m[0] for m in CITATION.findall(forms)] == ["Kajiya", "Veach", "Born", "Heitz", "Wächter"]
