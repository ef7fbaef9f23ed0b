"""Layout by tools, and words that have no place in the repository."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

# Absolute paths of somebody's machine, and package mirrors of one network.
FORBIDDEN = {
    "a path of one machine": re.compile(r"(?<![\w.])/(?:work|home|root|Users)/\w"),
    "a package mirror": re.compile(r"https?://[^\s\"')]*(?:/simple\b|artifactory|\bnexus\b)"),
}
TEXT = {".py", ".h", ".cpp", ".md", ".toml", ".bib", ".txt", ".yml", ".yaml", ".sh", ".cff", ""}


def tracked(root) -> list[Path]:
    if shutil.which("git") is None or not (root / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, check=True, text=True).stdout
    files = [root / name for name in listed.split("\0") if name]
    assert files
    return [path for path in files if path.is_file()]


def tool(name: str) -> str:
    """A program of this environment."""
    found = shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


def run(*command, cwd) -> None:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]


def test_ruff_finds_nothing(root):
    run(tool("ruff"), "check", ".", cwd=root)


def test_python_is_formatted(root):
    run(tool("ruff"), "format", "--diff", "--quiet", ".", cwd=root)


def test_native_is_formatted(root):
    sources = [str(p) for p in tracked(root) if p.suffix in (".h", ".cpp") and "native/src" in p.as_posix()]
    run(tool("clang-format"), "--dry-run", "--Werror", *sources, cwd=root)


def test_no_forbidden_words(root):
    wrong = []
    for path in tracked(root):
        if path.suffix not in TEXT or path == Path(__file__):
            continue
        for number, line in enumerate(path.read_text(errors="ignore").splitlines(), 1):
            wrong += [
                f"{path.relative_to(root)}:{number}: {what}: {line.strip()[:80]}"
                for what, pattern in FORBIDDEN.items()
                if pattern.search(line)
            ]
    assert not wrong, "\n".join(wrong)


def test_no_lock_file_is_tracked(root):
    assert not [p for p in tracked(root) if p.name == "uv.lock"]


def test_files_open_with_what_they_are(root):
    """Sources start with a comment or docstring."""
    starts = {".py": ('"""', "#"), ".h": ("//",), ".cpp": ("//",)}
    wrong = []
    for path in tracked(root):
        text = path.read_text(errors="ignore") if path.suffix in starts else ""
        if text and not text.startswith(starts[path.suffix]):
            wrong.append(str(path.relative_to(root)))
    assert not wrong, wrong


def test_versions_are_pinned_exactly(root):
    """One version of everything, so that what passed the tests is what runs."""
    text = (root / "pyproject.toml").read_text() + (root / "native/pyproject.toml").read_text()
    requirements = re.findall(r'^\s*"([A-Za-z][\w.-]*)([^";]*)[";]', text, re.M)
    loose = [
        name for name, version in requirements if not version.strip().startswith("==") and name != "gi-engine-native"
    ]
    assert requirements
    assert not loose
