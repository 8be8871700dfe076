"""Colours that people with any kind of colour vision can tell apart (Okabe and Ito 2008), and what each stands for."""

INK, SOFT, GRID = "#222222", "#777777", "#DDDDDD"
BLUE, ORANGE, GREEN, PINK, AMBER, SKY, BROWN = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D31"
PALE = "#B8B8B8"
MANY = (BLUE, ORANGE, GREEN, PINK, AMBER, SKY, SOFT, BROWN)
"""Of joints or laws, over again where there are more."""
MEASURED, NOMINAL, FOUND = INK, ORANGE, BLUE
"""What was measured, what the model said that was given, what the one says that was found."""
CELLS = ("#F4F8FC", "#08519C")
"""Of the least and of the greatest value of a table of cells."""
SCALE = ("#FFF3C4", "#FDC865", "#F28A2E", "#C8421F", "#7A1430")
"""Of the value of a joint, from none to the most."""
STATUS = {
    "ok": GREEN,
    "no_payload": PALE,
    "warming_up": "#F0E442",
    "not_excited": SKY,
    "not_physical": PINK,
    "stale": "#555555",
    "inconsistent": ORANGE,
}
EVENT = {"pick": (INK, "solid"), "drop": (INK, "dashed"), "external_force": (PINK, "dotted")}


def of_status(status: str) -> str:
    """The colour of a status; black where it is not known."""
    return STATUS.get(status, "#000000")
