"""Contact pairs, their friction and the preload of bolts in an Abaqus or CalculiX deck."""

from __future__ import annotations

from ..data import Joint
from ..errors import of_file
from .cards import fields
from .deck import Deck
from .raw import Damaged, real

KEYWORDS = ("CONTACT PAIR", "SURFACE INTERACTION", "FRICTION", "SURFACE BEHAVIOR", "PRE-TENSION SECTION", "CLOAD")


def joints_of(deck: Deck) -> list[Joint]:
    """The contact pairs: names of slave and master surface in the whole, and their coefficient of friction.

    Raises:
        Damaged: with the line, a surface that is not defined.
    """
    friction, current = dict[str, float](), ""
    for card, _ in deck.links:
        if card.keyword == "SURFACE INTERACTION":
            current = card.parameters.get("NAME", "").upper()
        elif card.keyword == "FRICTION" and card.lines:
            with of_file(card.place):
                value = real(card.lines[0].split(",")[0], f"*{card.keyword}")
                if not 0 <= value < float("inf"):
                    text = f"*FRICTION has the coefficient {value:g}; write one of 0 or more"
                    raise Damaged(text)
            friction[current] = value
    known = {name.upper(): name for name, *_ in deck.surfaces}
    laws = {card.parameters.get("NAME", "").upper() for card, _ in deck.links if card.keyword == "SURFACE INTERACTION"}
    found = []
    for card, space in deck.links:
        for line in card.lines if card.keyword == "CONTACT PAIR" else ():
            words = fields(line)[:2]
            keys = [deck.key(known, word, space) for word in words]
            if len(words) < 2 or None in keys:
                text = f"*CONTACT PAIR names '{line[:60]}', which are not two surfaces of the file"
                raise Damaged(text, file=card.place)
            law = card.parameters.get("INTERACTION", "").upper()
            if law and law not in laws:
                text = f"*CONTACT PAIR names the interaction '{law}', which is not defined"
                raise Damaged(text, file=card.place)
            mu = friction.get(law)
            found.append(Joint(f"{card.where}: *CONTACT PAIR", known[str(keys[0])], known[str(keys[1])], mu))
    return found


def unread(deck: Deck) -> list[str]:
    """What is said of contacts whose law is more than one coefficient, or that are tied."""
    said = []
    for card, _ in deck.links:
        if card.keyword == "FRICTION" and (card.parameters or len(card.lines) > 1):
            said.append(f"{card.where}: of *FRICTION only the first coefficient is read")
        if card.keyword == "SURFACE BEHAVIOR":
            said.append(f"{card.where}: *SURFACE BEHAVIOR is not read: a case guesses the stiffness by the area")
        if card.keyword == "CONTACT PAIR" and "TIED" in card.parameters:
            said.append(f"{card.where}: *CONTACT PAIR, TIED is taken as a contact with friction; write *TIE for a tie")
    return said


def preloads_of(deck: Deck) -> list[tuple[str, float]]:
    """Of every *PRE-TENSION SECTION the force of *CLOAD on its node, along its first direction.

    Raises:
        Damaged: with the line, a section without a node.
    """
    found = []
    for card, space in deck.links:
        if card.keyword != "PRE-TENSION SECTION":
            continue
        nodes = deck.nodes(card.parameters.get("NODE", "-"), space)
        if nodes is None or len(nodes) != 1:
            text = "*PRE-TENSION SECTION names no single NODE of the file"
            raise Damaged(text, file=card.place)
        forces = [force for node, force in _loads(deck) if node == nodes[0]]
        if forces:
            found.append((f"{card.where}: *PRE-TENSION SECTION", forces[-1]))
    return found


def unpressed(deck: Deck) -> list[str]:
    """What is said of sections without such a force."""
    pressed = {where for where, _ in preloads_of(deck)}
    every = [f"{card.where}: *PRE-TENSION SECTION" for card, _ in deck.links if card.keyword == "PRE-TENSION SECTION"]
    return [
        f"{w} has no *CLOAD on its node: its preload is not taken, write it yourself" for w in every if w not in pressed
    ]


def unused_loads(deck: Deck) -> list[str]:
    """Keywords of loads that are no preloads of bolts."""
    sections = [card.parameters.get("NODE", "-") for card, _ in deck.links if card.keyword == "PRE-TENSION SECTION"]
    bolts = {int(n) for word in sections if (found := deck.nodes(word)) is not None for n in found}
    return ["CLOAD"] if any(node not in bolts for node, _ in _loads(deck)) else []


def _loads(deck: Deck) -> list[tuple[int, float]]:
    """Node and force of every concentrated load along the first direction."""
    found = []
    for card, space in deck.links:
        for line in card.lines if card.keyword == "CLOAD" else ():
            words = [word.strip() for word in line.split(",")]
            nodes = deck.nodes(words[0], space)
            if nodes is not None and len(words) > 2:
                with of_file(card.place):
                    along = real(words[2], f"*{card.keyword}") if words[1] == "1" else 0.0
                found += [(int(node), along) for node in nodes]
    return found
