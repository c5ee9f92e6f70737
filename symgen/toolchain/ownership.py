"""Write permissions of files and folders, checked before code from them is executed."""

from __future__ import annotations

import os
import stat
from pathlib import Path

_ROOT = 0


def belongs_to_user(path: Path) -> bool:
    """Return whether a file or folder belongs to the current user or root and only the owner can write to it.

    Symbolic links do not qualify. Platforms without POSIX users (Windows) are not checked.
    """
    status = path.lstat()
    return not stat.S_ISLNK(status.st_mode) and not _of_others(status)


def fault(folder: Path) -> str:
    """Return the reason why other users can write to or replace a folder; empty if they cannot.

    Parent folders may be writable by others only with the sticky bit set, as for ``/tmp``.
    """
    place = folder.resolve()
    status = place.stat()
    if _of_others(status):
        return f"it belongs to user {status.st_uid}, with mode {stat.S_IMODE(status.st_mode):04o}"
    for above in place.parents:
        mode = above.stat().st_mode
        if _posix() and mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return f"everybody can replace it, as {above} has mode {stat.S_IMODE(mode):04o}"
    return ""


def _of_others(status: os.stat_result) -> bool:
    if not _posix():
        return False
    if status.st_uid not in (os.geteuid(), _ROOT):
        return True
    shared = status.st_mode & stat.S_IWGRP and not is_private(status.st_gid, status.st_uid)
    return bool(shared or status.st_mode & stat.S_IWOTH)


def is_private(group: int, user: int) -> bool:
    """Return whether a group is a user's private group: it has the user's name and no other members."""
    import grp
    import pwd

    try:
        of_group, of_user = grp.getgrgid(group), pwd.getpwuid(user)
    except KeyError:
        return False
    return of_group.gr_name == of_user.pw_name and not {*of_group.gr_mem} - {of_user.pw_name}


def _posix() -> bool:
    return hasattr(os, "geteuid")
