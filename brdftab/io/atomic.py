"""Output files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from brdftab.errors import BrdftabError, OutputExistsError


def show(path: str | os.PathLike[str]) -> str:
    """Return a path for a one-line message: as it is, or quoted where it holds control characters."""
    text = os.fspath(path)
    return text if text.isprintable() else repr(text)


def check_target(path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Check that an output may be written and return the file behind its links.

    Parameters
    ----------
    path : str or path-like
        The output file.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        Absolute path without symbolic links, so that a link stays one when its file is replaced.

    Raises
    ------
    OutputExistsError
        Where the file exists and `overwrite` is False.
    BrdftabError
        Where the folder is missing or not writable, or the path is no regular file.
    """
    try:
        target = Path(os.path.realpath(path))
        exists, regular, folder = target.exists(), target.is_file(), target.parent.is_dir()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise BrdftabError(f"cannot write {show(path)} ({reason}); choose another path") from error
    if exists and not regular:
        raise BrdftabError(f"cannot write {show(path)}: it is not a regular file; choose another path")
    if exists and not overwrite:
        raise OutputExistsError(f"{show(path)} exists; pass --overwrite (overwrite=True) or choose another path")
    if not folder:
        raise BrdftabError(
            f"cannot write {show(path)}: the folder {show(target.parent)} does not exist; create it first"
        )
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise BrdftabError(f"cannot write {show(path)}: the folder {show(target.parent)} is not writable")
    return target


_unfinished: set[Path] = set()


def discard() -> None:
    """Remove all unfinished outputs of this process, for an end that leaves no time for `atomic` to do so."""
    for path in list(_unfinished):
        with contextlib.suppress(OSError):
            os.unlink(path)


@contextlib.contextmanager
def atomic(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[Path]:
    """Give a temporary path in the output's folder and move it to the output when the block ends well.

    Parameters
    ----------
    path : str or path-like
        The output file.
    overwrite : bool
        Whether an existing file may be replaced.

    Yields
    ------
    Path
        An empty temporary file with the same ending; it is removed on any failure, a keyboard interrupt included.

    Raises
    ------
    OutputExistsError
        Where the file exists, or appeared meanwhile, and `overwrite` is False.
    BrdftabError
        Where the system refuses to write.
    """
    target = check_target(path, overwrite=overwrite)
    temporary = target.with_name(f".brdftab-{secrets.token_hex(8)}{target.suffix}")
    _unfinished.add(temporary)
    try:
        # os.open keeps the user's umask, which tempfile.mkstemp would narrow to 0600
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield temporary
        _publish(temporary, target, overwrite)
    except FileExistsError as error:
        raise OutputExistsError(f"{show(path)} exists; pass --overwrite (overwrite=True)") from error
    except OSError as error:
        raise BrdftabError(
            f"cannot write {show(path)} ({error.strerror or error}); check the folder and disk"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        _unfinished.discard(temporary)


def _publish(temporary: Path, target: Path, overwrite: bool) -> None:
    """Move the finished file to its name in one step; without `overwrite` a file that appeared meanwhile is kept."""
    if not overwrite:
        try:
            os.link(temporary, target)
            return
        except FileExistsError:
            raise
        except OSError:
            # file systems without hard links: the check just before is the best there is
            if target.exists():
                raise FileExistsError(str(target)) from None
    os.replace(temporary, target)


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> None:
    """Write UTF-8 text whole or not at all; raises as `atomic`."""
    with atomic(path, overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")
