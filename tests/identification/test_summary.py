"""Test the screen that a trace ends with."""

from made_diagnosis import PAYLOAD, diagnosis

from experiments.arm_catalogue import candidates
from serpent_twin.identification.diagnosis import Tried
from serpent_twin.identification.summary import summary
from serpent_twin.identification.unexplained import Unexplained


def test_what_is_missing_stands_with_number_interval_and_error():
    said = summary(diagnosis(effects=(PAYLOAD,)), candidates())
    mass = PAYLOAD.parameters["mass"]
    assert f"{mass.value:.3g}" in said and f"{mass.low:.3g} … {mass.high:.3g}" in said
    assert "nominal →" in said and "→" in said and "corrected" in said
    assert max(map(len, said.splitlines())) <= 110 and len(said.splitlines()) < 40


def test_nothing_missing_and_nothing_explained_begin_unlike():
    assert "nothing" in summary(diagnosis(), candidates()).splitlines()[0]
    rest = Unexplained(True, 0.4, "The markers follow motor 3's angle.")
    first, *others = summary(diagnosis(unexplained=rest), candidates()).splitlines()
    assert "no known effect explains" in first
    assert any("Unexplained: The markers follow motor 3's angle." in line for line in others)


def test_a_candidate_that_may_be_chance_is_named_where_nothing_is_found():
    rest = Unexplained(True, 0.4, "The markers follow motor 3's angle.")
    why = "13.5 % better on held-out logs; its strength may be zero"
    doubted = Tried("hinge_friction@elbow", 1.0, "rejected", 0.2, None, why, doubt=1e-4)
    tried = (*diagnosis().candidates, doubted)
    said = " ".join(summary(diagnosis(unexplained=rest, candidates=tried), candidates()).split())
    assert f"Hinge friction at elbow is not sure: {why}. More logs may show it." in said
    found = diagnosis(effects=(PAYLOAD,), unexplained=rest, candidates=tried)
    assert "is not sure" not in summary(found, candidates())


def test_numbers_of_the_model_that_the_logs_make_different_are_told():
    said = " ".join(summary(diagnosis(), candidates()).split())
    assert "By the logs, strand stiffness 1+ is 22.1 kN/m (in the model 18.8)." in said
    assert "strand slack" not in said.partition("By the logs,")[2].partition(".")[0]
