"""Contact pairs, their friction, the preload of bolts and cyclic symmetry in an Abaqus or CalculiX deck."""

from __future__ import annotations

from ..data import Joint, Sector
from ..errors import of_file
from .cards import Card, fields, numbers
from .deck import Deck
from .raw import Damaged, is_number, lost, real

MODEL, CHOSEN, BOLT = "CYCLIC SYMMETRY MODEL", "SELECT CYCLIC SYMMETRY MODES", "PRE-TENSION SECTION"
KEYWORDS = (
    MODEL,
    CHOSEN,
    BOLT,
    "CONTACT PAIR",
    "SURFACE INTERACTION",
    "FRICTION",
    "SURFACE BEHAVIOR",
    "CLOAD",
)


def joints_of(deck: Deck) -> list[Joint]:
    """The contact pairs: names of slave and master surface in the whole, and their coefficient of friction.

    Raises:
        Damaged: with the line, a surface that is not defined.
    """
    friction, current = dict[str, float](), ""
    for card in deck.links:
        if card.keyword == "SURFACE INTERACTION":
            current = card.word("NAME")
        elif card.keyword == "FRICTION" and card.lines:
            with of_file(card.place):
                value = real(card.lines[0].split(",")[0], "*FRICTION")
                if not 0 <= value < float("inf"):
                    raise Damaged(
                        f"*FRICTION has the coefficient {value:g}; write one of 0 or more"
                    )
            friction[current] = value
    laws = {card.word("NAME") for card in deck.linking("SURFACE INTERACTION")}
    joints = []
    for card in deck.linking("CONTACT PAIR"):
        law = card.word("INTERACTION")
        for line in card.lines:
            with of_file(card.place):
                names = [deck.surface(word, card.space) for word in fields(line)[:2]]
                if len(names) < 2 or None in names:
                    raise Damaged(
                        f"*CONTACT PAIR names '{line[:60]}', which are not two surfaces of the file"
                    )
                if law and law not in laws:
                    raise Damaged(
                        f"*CONTACT PAIR names the interaction '{law}', which is not defined"
                    )
            slave, master = map(str, names)
            joints.append(Joint(f"{card.where}: *CONTACT PAIR", slave, master, friction.get(law)))
    return joints


def unread(deck: Deck) -> list[str]:
    """What is said of contacts whose law is more than one coefficient, or that are tied."""
    said = []
    for card in deck.links:
        if card.keyword == "FRICTION" and ({*card.parameters} - {"SLIP TOLERANCE"} or len(card.lines) > 1):
            said.append(f"{card.where}: of *FRICTION only the first coefficient is read")
        if card.keyword == "SURFACE BEHAVIOR":
            said.append(
                f"{card.where}: *SURFACE BEHAVIOR is not read: a case guesses the stiffness by the area"
            )
        if card.keyword == "CONTACT PAIR" and "TIED" in card.parameters:
            said.append(
                f"{card.where}: *CONTACT PAIR, TIED is taken as a contact with friction; write *TIE for a tie"
            )
    return said


def preloads_of(deck: Deck) -> tuple[list[tuple[str, float]], list[str]]:
    """Of every *PRE-TENSION SECTION the force of *CLOAD on its node, along its first direction; and what is said of
    sections without one.

    Raises:
        Damaged: with the line, a section without a node.
    """
    loads = _loads(deck)
    preloads, unpressed = [], []
    for card in deck.linking(BOLT):
        nodes = deck.nodes(card.parameters.get("NODE", "-"), card.space)
        if nodes is None or len(nodes) != 1:
            raise Damaged(f"*{BOLT} names no single NODE of the file", file=card.place)
        where, forces = (
            f"{card.where}: *{BOLT}",
            [force for node, force in loads if node == nodes[0]],
        )
        if forces:
            preloads.append((where, forces[-1]))
        else:
            unpressed.append(
                f"{where} has no *CLOAD on its node: its preload is not taken, write it yourself"
            )
    return preloads, unpressed


def _loads(deck: Deck) -> list[tuple[int, float]]:
    """Node and force of every concentrated load along the first direction."""
    loads = []
    for card in deck.linking("CLOAD"):
        for line in card.lines:
            words = [word.strip() for word in line.split(",")]
            nodes = deck.nodes(words[0], card.space)
            if nodes is not None and len(words) > 2:
                with of_file(card.place):
                    along = real(words[2], "*CLOAD") if words[1] == "1" else 0.0
                loads += [(int(node), along) for node in nodes]
    return loads


def sector_of(deck: Deck) -> tuple[Sector | None, list[str]]:
    """The sector by *CYCLIC SYMMETRY MODEL and its *TIE, and what of them is not read, in words.

    Raises:
        Damaged: with the line, a model that does not say its sectors, its axis or its faces.
    """
    models = deck.linking(MODEL)
    ties = [card for card in deck.linking("TIE") if "CYCLIC SYMMETRY" in card.parameters]
    if len(models) > 1:
        text = f"*{MODEL} is there {len(models)} times: a multistage model is not read"
        raise Damaged(f"{text}; write a deck of each stage and import these", file=models[1].place)
    if not models:
        return None, [lost(card.where, f"*{card.keyword} of CYCLIC SYMMETRY") for card in ties]
    (model,) = models
    named, sectors = model.word("TIE"), model.text("N")
    chosen = [tie for tie in ties if named in ("", tie.word("NAME"))]
    with of_file(model.place):
        ends = [v for row in numbers(model.lines, f"*{MODEL}") for v in row]
        if not is_number(sectors) or len(ends) != 6 or len(chosen) != 1:
            raise Damaged(
                f"*{MODEL} needs N, two points of its axis (six numbers) and the TIE of its faces"
            )
    (tie,) = chosen
    with of_file(tie.place):
        faces = [
            deck.surface(word, tie.space) for line in tie.lines for word in line.split(",")[:2]
        ]
        if len(faces) != 2 or None in faces:
            raise Damaged("*TIE, CYCLIC SYMMETRY names no two surfaces of the file")
    one, other = map(str, faces)
    axis = [b - a for a, b in zip(ends[:3], ends[3:], strict=True)]
    picked = next(iter(deck.linking(CHOSEN)), Card(""))
    first, last = (
        int(word) if is_number(word) else None for word in map(picked.text, ("NMIN", "NMAX"))
    )
    diameters = (
        ()
        if last is None
        else tuple(
            range(
                first or 0,
                min(last, int(sectors) // 2) + 1,
                2 if "EVEN" in picked.parameters else 1,
            )
        )
    )
    where = f"{model.where}: *{MODEL}"
    return Sector(where, int(sectors), (one, other), tuple(axis), tuple(ends[:3]), diameters), []
