"""Which model a scene needs, why, and what it will cost: the rules of the ladder, checked by short pilot runs."""

from drillfem.plan.pilot import Pilot, run_pilot
from drillfem.plan.report import as_text
from drillfem.plan.survey import Plan, Rung, plan_of

__all__ = ["Pilot", "Plan", "Rung", "as_text", "plan_of", "run_pilot"]
