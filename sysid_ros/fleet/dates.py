"""Dates of bags whose own stamps say nothing: told in robots.yaml by a rule on the path, by a table, or as campaigns only."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from sysid_ros.exceptions import SettingsError, in_a_line

KEYS = frozenset({"date", "dates", "campaign", "campaigns"})
"""Of a rule, which tell when its bags were recorded."""
_PARTS = ("year", "month", "day", "hour", "minute", "second")
_NEEDED = 3
_EXAMPLE = r"'(?P<year>\d{4})-(?P<month>\d\d)-(?P<day>\d\d)'"
_EARLIEST, _END = 1970, 2200


@dataclass(frozen=True, slots=True)
class Told:
    """What is told of when a bag was recorded.

    Attributes:
        date: in UTC; None where the bag's own first stamp counts, or where only the campaign is known. campaign: name of what it
            was recorded in, whose bags have no date that counts; empty without one. order: place of the campaign among those of
            its robot from 0; None where their order is not known.
    """

    date: datetime | None = None
    campaign: str = ""
    order: int | None = None

    @property
    def key(self) -> str:
        """In one word, empty where nothing is told."""
        when = self.date.astimezone(UTC).isoformat() if self.date is not None else ""
        return f"{when}|{self.campaign}|{'' if self.order is None else self.order}".strip("|")

    def columns(self, own: datetime | None) -> dict[str, Any]:
        """Of the table ``bags``, for a bag whose own date is ``own``."""
        return {
            "date": self.dated(own),
            "date_told": self.date is not None,
            "campaign": self.campaign,
            "campaign_order": self.order,
        }

    def dated(self, own: datetime | None) -> datetime | None:
        """The date that counts, for a bag whose own one is ``own``."""
        return None if self.date is None and self.campaign else self.date or own


def told_in(row: Mapping[str, Any]) -> Told:
    """What was told of the bag of a row of the table ``bags``."""
    return Told(row["date"] if row.get("date_told") else None, row.get("campaign") or "", row.get("campaign_order"))


class DateRule:
    r"""How a rule tells dates::

        date: '(?P<year>\d{4})-(?P<month>\d\d)-(?P<day>\d\d)'  # searched in the path; hour, minute, second may follow
        dates: dates.csv          # or a table with the columns bag (its path, or the end of it) and date (ISO 8601)
        campaign: "{1}"           # or, where no date is known, which bags were recorded together,
        campaigns: [first, next]  # and in which order, where that is known

    Args:
        values: the rule. folder: that paths count from. where: name of the rule in messages.

    Raises:
        SettingsError: it tells dates in more than one way, or not as above.
    """

    def __init__(self, values: Mapping[str, Any], folder: Path, where: str) -> None:
        given = sorted({"date", "dates", "campaign"} & set(values))
        if len(given) > 1:
            raise SettingsError(f"{where} has {' and '.join(given)}, which tell the same in two ways. Leave all but one out.")
        self._where, self._pattern = where, _pattern(values["date"], where) if "date" in values else None
        self._table = _table(folder / str(values["dates"]), where) if "dates" in values else None
        self._campaign = str(values.get("campaign") or "")
        self._order = _order(values.get("campaigns"), where)
        if self._order and not self._campaign:
            raise SettingsError(
                f"{where}: 'campaigns' is the order of campaigns, but there is no 'campaign'. Add it, such as \"{{1}}\"."
            )

    def of(self, bag: str, campaign: str) -> Told:
        """What is told of a bag.

        Args:
            bag: path or URL. campaign: :attr:`campaign` with the stars of its path filled in.

        Raises:
            SettingsError: the rule has dates or an order, and none for this bag.
        """
        if self._pattern is not None:
            return Told(self._in_path(self._pattern, bag))
        if self._table is not None:
            return Told(self._in_table(self._table, bag))
        if campaign and self._order and campaign not in self._order:
            raise SettingsError(
                f"{self._where}: bag '{bag}' is of campaign '{campaign}', which is none of 'campaigns': "
                f"{', '.join(self._order)}. Add it there in its place, or leave 'campaigns' out where the order is not known."
            )
        return Told(None, campaign, self._order.index(campaign) if campaign and self._order else None)

    @property
    def campaign(self) -> str:
        """As it is written, with {1} and so on."""
        return self._campaign

    def _in_path(self, pattern: re.Pattern[str], bag: str) -> datetime:
        found = pattern.search(bag)
        if found is None:
            raise SettingsError(
                f"{self._where}: 'date' {pattern.pattern!r} does not fit the path of bag '{bag}'. Make it fit, or give such bags "
                "a rule of their own before this one."
            )
        groups = found.groupdict()
        try:
            year, month, day, hour, minute, second = (int(groups.get(part) or 0) for part in _PARTS)
            return _checked(datetime(year, month, day, hour, minute, second, tzinfo=UTC))
        except ValueError as error:
            raise SettingsError(
                f"{self._where}: 'date' finds '{found.group()}' in bag '{bag}', which is no date: {error}."
            ) from None

    def _in_table(self, table: tuple[Path, dict[str, datetime]], bag: str) -> datetime:
        path, dates = table
        parts = bag.split("/")
        for k in range(len(parts)):
            if (found := dates.get("/".join(parts[k:]))) is not None:
                return found
        raise SettingsError(f"{self._where}: '{path}' has no line for bag '{bag}'. Add one, with its path or the end of it.")


def _pattern(given: Any, where: str) -> re.Pattern[str]:
    try:
        pattern = re.compile(str(given))
    except re.error as error:
        raise SettingsError(
            f"{where}: 'date' is {given!r}, which is no regular expression: {error}. An example: {_EXAMPLE}."
        ) from None
    groups = set(pattern.groupindex)
    if missing := [part for part in _PARTS[:_NEEDED] if part not in groups]:
        raise SettingsError(f"{where}: 'date' is {given!r}, without a group named {', '.join(missing)}. An example: {_EXAMPLE}.")
    if unknown := sorted(groups - set(_PARTS)):
        raise SettingsError(f"{where}: 'date' has groups {', '.join(unknown)}; those of a date are {', '.join(_PARTS)}.")
    return pattern


def _order(given: Any, where: str) -> tuple[str, ...]:
    if given is None:
        return ()
    if not isinstance(given, list) or not given or len(set(map(str, given))) < len(given):
        raise SettingsError(f"{where}: 'campaigns' is {given!r}; it must be a list of names in the order of time, each once.")
    return tuple(map(str, given))


@cache
def _table(path: Path, where: str) -> tuple[Path, dict[str, datetime]]:
    """The dates of a CSV file by bag."""
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SettingsError(f"{where}: 'dates' names '{path}', which can't be read: {in_a_line(error)}.") from None
    if not rows or [cell.strip() for cell in rows[0]] != ["bag", "date"]:
        raise SettingsError(f"{where}: the first line of '{path}' must be 'bag,date'; each that follows a path and its date.")
    dates: dict[str, datetime] = {}
    for number, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        bag, text = (row[0].strip().strip("/"), row[1].strip()) if len(row) == 2 else ("", "")
        try:
            when = _checked(datetime.fromisoformat(text))
        except ValueError:
            raise SettingsError(
                f"{where}: line {number} of '{path}' is '{','.join(row)}'; it must be a bag and a date, such as "
                "cell_3/bag_7,2026-03-14 or cell_3/bag_7,2026-03-14T09:30+01:00."
            ) from None
        if not bag or dates.get(bag, when) != when:
            raise SettingsError(
                f"{where}: line {number} of '{path}' {'gives bag ' + bag + ' a second date' if bag else 'names no bag'}."
            )
        dates[bag] = when
    return path, dates


def _checked(when: datetime) -> datetime:
    """In UTC, also where no zone is said.

    Raises:
        ValueError: no robot recorded then.
    """
    if not _EARLIEST <= when.year < _END:
        raise ValueError(f"the year {when.year} is not from {_EARLIEST} to {_END - 1}")
    return when.replace(tzinfo=UTC) if when.tzinfo is None else when.astimezone(UTC)
