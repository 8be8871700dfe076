"""Colours that people with any kind of colour vision can tell apart (Okabe and Ito 2008), and what each stands for."""

INK = "#222222"
GRID = "#DDDDDD"
CURVES = {
    "mass": "#0072B2", "x": "#0072B2", "y": "#D55E00", "z": "#009E73",
    "Ixx": "#0072B2", "Iyy": "#D55E00", "Izz": "#009E73",
}  # fmt: skip
STATUS = {
    "ok": "#009E73",
    "no_payload": "#B8B8B8",
    "warming_up": "#F0E442",
    "not_excited": "#56B4E9",
    "not_physical": "#CC79A7",
    "stale": "#555555",
    "inconsistent": "#D55E00",
}
UNKNOWN_STATUS = "#000000"
EVENT = {"pick": "#222222", "drop": "#222222", "change": "#222222", "external_force": "#CC79A7"}
EVENT_DASH = {"pick": "solid", "drop": "dashed", "change": "dashdot", "external_force": "dotted"}
