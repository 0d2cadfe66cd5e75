#!/usr/bin/env python3
"""Finds all calls in sources and scripts that remove, shorten or overwrite files, and compares them with the listed ones.

Only take/take_removal.cc deletes footage. Another call needs a line in removal_calls.txt that says why it cannot reach a file
of a take, or why it may.

usage: removal_calls.py SOURCE_DIR    compares
       removal_calls.py --self-test   finds each forbidden call in sources of its own
"""
import collections
import pathlib
import re
import sys
import tempfile

# Not tests: they write into folders of their own.
UNSEARCHED = {"tests", "build"}
# The language of a script without a first line "#!".
LANGUAGES = {".py": "python", ".mjs": "node", ".js": "node", ".ts": "node", ".sh": "sh"}

# Functions of C and C++ that remove, shorten or overwrite a file, or run a program that may.
FUNCTIONS = """unlink unlinkat rmdir remove remove_all rename renameat renameat2 resize_file truncate truncate64 ftruncate
    ftruncate64 creat creat64 fallocate posix_fallocate fopen freopen copy_file system popen""".split()
# Functions with the name of a harmless one: only with this qualifier.
QUALIFIED = r"io\s*::\s*replace_file|(?:fs|filesystem)\s*::\s*copy"
# Types and constants that open a file for writing.
NAMES = "ofstream fstream basic_ofstream O_TRUNC O_WRONLY O_RDWR kWriteExisting overwrite_existing MAP_SHARED".split()
# A method of another class has the same name: v.remove(x), Folder::remove(). So has a declaration: void remove(x).
NOT_BEFORE = r"(?<![\w.:])(?<!->)"
QUALIFIER = r"(?:(?:std|fs|filesystem|io|v3d)\s*::\s*|(?<!\w)::\s*)*"
CALL = re.compile(NOT_BEFORE + "(?:" + QUALIFIER + r"(?<!\w)(" + "|".join(FUNCTIONS) + ")|(" + QUALIFIED + r"))\s*\(")
NAME = re.compile(r"\b(" + "|".join(NAMES) + r")\b")
COMMENT_OR_TEXT = re.compile(
    r"""//[^\n]*|/\*.*?\*/|^[ \t]*#\s*include[^\n]*|R"\((?:.*?)\)"|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])'""", re.S | re.M)
# Words before a call; any other word is the type of a declaration.
KEYWORDS = {"return", "co_return", "else", "do", "throw", "and", "or", "not"}

SHELL = {
    "rm": r"(?<![\w./-])rm\s+(?=[-\w\"'$./])", "rmdir": r"(?<![\w./-])rmdir\s", "unlink": r"(?<![\w./-])unlink\s",
    "mv": r"(?<![\w./-])mv\s", "truncate": r"(?<![\w./-])truncate\s", "shred": r"(?<![\w./-])shred\s",
    "-delete": r"\s-delete\b", "--delete": r"\s--delete\b", "dd of=": r"\bdd\s[^\n]*\bof=", "cp": r"(?<![\w./-])cp\s",
    "tee": r"(?<![\w./-])tee\s", "sed -i": r"\bsed\s+-\w*i", "ln -f": r"\bln\s+-\w*f",
    "install": r"(?<![\w./-])(?<!get )install\s+-",
    # A redirection that is no >>, >&2, >/dev/null, =>, ->, <tag> or comparison.
    ">": r"(?:(?<![>=\-&<\w])[12&]?>\s*(?![>&=(\s]|/dev/null)|[a-z]>(?![/\"]dev/null)(?=[\"'$/]))[^\s;|)]",
}
PYTHON = {
    "rmtree": r"\brmtree\(", "os.remove": r"\bos\.(?:remove|unlink|rmdir|removedirs|truncate|rename|replace)\(",
    "unlink": r"\.unlink\(", "rmdir": r"\.rmdir\(", "rename": r"(?<!os)\.rename\(", "move": r"\bshutil\.(?:move|copy\w*)\(",
    "open for writing": r"\bopen\([^)\n]*[\"'](?:[wx]\w*b?\+?|r\+b?|a\w*)[\"']", "write_text": r"\.write_(?:text|bytes)\(",
    "truncate": r"\.truncate\(", "savefig": r"\.savefig\(",
}
SCRIPT = {
    "writeFile": r"\bwriteFile(?:Sync)?\(", "rm": r"\b(?:rm|rmdir|unlink)(?:Sync)?\(", "rename": r"\brename(?:Sync)?\(",
    "createWriteStream": r"\bcreateWriteStream\(",
}


def without_comments_and_texts(source):
    """The source with line breaks, but without comments, preprocessor lines and the content of literals."""
    return COMMENT_OR_TEXT.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), source)


def calls_of_source(source):
    code = without_comments_and_texts(source)
    for found in CALL.finditer(code):
        before = re.search(r"(\w+)\s+$", code[:found.start()][-80:])
        if before is None or before.group(1) in KEYWORDS:
            yield found.group(1) or re.sub(r"\s", "", found.group(2))
    yield from (found.group(1) for found in NAME.finditer(code))


def calls_of_script(text):
    first = text.split("\n", 1)[0]
    language = PYTHON if "python" in first else SCRIPT if "node" in first else SHELL
    code = "\n".join("" if line.lstrip().startswith(("#", "//")) else line for line in text.split("\n"))
    # The help that a script prints.
    code = re.sub(r"<<-?'(USAGE|EOF)'.*?^\1$", "", code, flags=re.S | re.M) if language is SHELL else code
    for call, pattern in language.items():
        yield from (call for _ in re.finditer(pattern, code))


def calls_of(path):
    """Names of the calls in a file; none for a file that is neither a source nor a script."""
    if path.suffix in (".cc", ".h"):
        return calls_of_source(path.read_text())
    if path.suffix in (".png", ".jpg") or not path.is_file():
        return ()
    text = path.read_text(errors="replace")
    if path.suffix in LANGUAGES:
        return calls_of_script(f"#!{LANGUAGES[path.suffix]}\n{text}")
    return calls_of_script(text) if text.startswith("#!") else ()


def searched_folders(root):
    """The layers, the programs and the examples: every folder with a CMakeLists.txt, and examples, which is not built."""
    built = {path.parent for path in root.glob("*/CMakeLists.txt")}
    return sorted(folder for folder in built | {root / "examples"} if folder.name not in UNSEARCHED)


def calls_below(root):
    found = collections.Counter()
    for folder in searched_folders(root):
        for path in sorted(folder.rglob("*")):
            if "node_modules" in path.parts or "__pycache__" in path.parts or path.is_symlink() or path.is_dir():
                continue
            for call in calls_of(path):
                found[(str(path.relative_to(root)), call)] += 1
    return found


def listed_calls():
    """The lines `FILE CALL COUNT REASON` of removal_calls.txt. A call with spaces is in quotation marks."""
    listed = collections.Counter()
    for line in pathlib.Path(__file__).with_suffix(".txt").read_text().split("\n"):
        if not line or line.startswith("#"):
            continue
        file, call, count, reason = re.fullmatch(r"(\S+)\s+(\"[^\"]+\"|\S+)\s+(\d+)\s+(\S.*)", line).groups()
        listed[(file, call.strip('"'))] += int(count)
    return listed


def differences(root):
    found, listed = calls_below(root), listed_calls()
    for file, call in sorted(found.keys() | listed.keys()):
        if found[(file, call)] != listed[(file, call)]:
            yield f"{file}: {call}: found {found[(file, call)]}, listed {listed[(file, call)]} in removal_calls.txt"


SEEDS = {
    "x.cc": {
        "unlink": "unlink(path.c_str());", "unlinkat": "::unlinkat(AT_FDCWD, path, 0);", "rmdir": "  rmdir(path);",
        "remove": "std::remove(path);", "remove_all": "std::filesystem::remove_all(path);", "rename": "fs::rename(a, b);",
        "renameat": "renameat(1, a, 1, b);", "renameat2": "if (renameat2(1, a, 1, b, 0) != 0)",
        "resize_file": "std::filesystem::resize_file(path, 0);", "truncate": "if (truncate(path, 0) == 0) {}",
        "truncate64": "::truncate64(path, 0);", "ftruncate": "return ftruncate(fd, 0);", "ftruncate64": "ftruncate64 (fd, 0);",
        "creat": "const int fd = creat(path, 0644);", "creat64": "::creat64(path, 0644);",
        "fallocate": "fallocate(fd, FALLOC_FL_PUNCH_HOLE, 0, 9);", "posix_fallocate": "posix_fallocate(fd, 0, 9);",
        "fopen": 'FILE* f = std::fopen(path, "w");', "freopen": 'freopen(path, "w", stdout);',
        "copy_file": "fs::copy_file(a, b, fs::copy_options::update_existing);", "fs::copy": "fs::copy(a, b);",
        "io::replace_file": "io::replace_file(path, text);", "system": 'std::system("rm x");', "popen": 'popen("rm x", "r");',
        "ofstream": "std::ofstream(path) << 1;", "fstream": "std::fstream file(path);",
        "basic_ofstream": "std::basic_ofstream<char> file(path);", "O_TRUNC": "open(path, O_TRUNC);",
        "O_WRONLY": "open(path, O_WRONLY);", "O_RDWR": "open(path, O_RDWR);",
        "kWriteExisting": "File::open(path, OpenMode::kWriteExisting);", "MAP_SHARED": "mmap(0, 9, 3, MAP_SHARED, fd, 0);",
        "overwrite_existing": "options = fs::copy_options::overwrite_existing;",
    },
    "x.sh": {
        "rm": 'rm -rf "$out/takes"', "rmdir": "rmdir glb", "unlink": "unlink file", "mv": 'mv "$a" "$b"', "shred": "shred file",
        "truncate": 'truncate -s 0 "$log"', "-delete": "find . -name '*.lcmlog' -delete", "--delete": "rsync -a --delete a b",
        "dd of=": "dd if=a of=b", "cp": "cp a b", "tee": "echo a | tee log", "sed -i": "sed -i s/a/b/ file",
        "ln -f": "ln -sf a b", "install": "install -m 644 a b", ">": 'echo a >"$file"',
    },
    "python": {
        "rmtree": "shutil.rmtree(take)", "os.remove": "os.remove(path)", "unlink": "path.unlink()", "rmdir": "path.rmdir()",
        "rename": "half.rename(take)", "move": "shutil.move(a, b)", "open for writing": 'open(path, "w")',
        "write_text": "path.write_text(text)", "truncate": "file.truncate(0)", "savefig": "figure.savefig(out)",
    },
    "x.mjs": {
        "writeFile": "fs.writeFileSync(path, text);", "rm": "await rm(path);", "rename": "renameSync(a, b);",
        "createWriteStream": "fs.createWriteStream(path)",
    },
}
HARMLESS = {
    "x.cc": """#include <fstream>
        // unlink(path)
        const char* advice = "remove(file), O_TRUNC";
        ghosts.remove(volume); folder->remove(); void Folder::remove() const {} void remove(Volume& volume);
        std::copy(a, b, c); replace_file(path, text); std::ifstream in(path); v3d::replace_file(path, text); if (a > b) {}""",
    "x.sh": "echo a >&2\n# rm -rf x\ncmake >/dev/null 2>&1\nctl arm x\necho a >>log\n[ \"$a\" -gt 2 ]\n",
    "python": 'open(path).read()\n# shutil.rmtree(x)\nopen(path, "rb")\n',
    "x.mjs": "fs.readFileSync(path); const f = (a) => a > 2;",
}
# Modules have no first line "#!".
SEEDS["module.py"], HARMLESS["module.py"] = SEEDS["python"], HARMLESS["python"]
SEEDS["x.ts"], HARMLESS["x.ts"] = SEEDS["x.mjs"], HARMLESS["x.mjs"]
CALLS = {"x.cc": [*FUNCTIONS, *NAMES], "x.sh": SHELL, "python": PYTHON, "module.py": PYTHON, "x.mjs": SCRIPT, "x.ts": SCRIPT}


def self_test():
    """Seeds a source tree with each call in turn."""
    for name, seeds in SEEDS.items():
        yield from (f"{name}: no seed of {call}" for call in CALLS[name] if call not in seeds)
        for call, line in [*seeds.items(), (None, HARMLESS[name])]:
            with tempfile.TemporaryDirectory() as folder:
                root = pathlib.Path(folder)
                (root / "layer").mkdir()
                (root / "layer/CMakeLists.txt").touch()
                (root / "layer" / name).write_text(("#!/usr/bin/env python3\n" if name == "python" else "") + line + "\n")
                found = {found_call for _, found_call in calls_below(root)}
            if found != ({call} if call else set()):
                yield f"{name}: {line}: expected {call}, found {sorted(found)}"


problems = list(self_test() if sys.argv[1] == "--self-test" else differences(pathlib.Path(sys.argv[1])))
print("\n".join(problems))
sys.exit(1 if problems else 0)
