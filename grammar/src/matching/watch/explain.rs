//! Which rules share the work of a watch, for people.
//!
//! Guarantee: what is said to be shared is what [`Watch`](super::Watch) does once for these rules where a link changes
//! in a graph with the same counts.

use super::super::MatchError;
use super::super::explain::Words;
use super::super::plan::plan;
use super::super::statistics::Statistics;
use super::shared::{Member, Part, Shared};
use super::trigger::{Anchor, Triggers};
use crate::{Grammar, Rule};
use dsr::{LabelId, Schema, Snapshot};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Rules with more links are left out: planning from each of them would take too long.
const LINKS: usize = 32;

/// Steps that a watch of several rules takes once for all of them, where a link came or changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SharedSteps {
    /// The label of the link.
    pub label: String,
    /// The rules, in the order of the grammar.
    pub rules: Vec<String>,
    /// In words, with the variables of the first of them: what is given, and then each step.
    pub steps: Vec<String>,
}

impl Grammar {
    /// Which rules share which steps where they are watched together (see [`Watch`](crate::Watch)) in a graph with the
    /// snapshot's counts; without a snapshot, in one of which nothing is known. Each set of rules comes with the longest
    /// beginning that all of them have in common. Rules with more than 32 links are not looked at.
    ///
    /// # Errors
    /// [`MatchError`], as for [`Self::matches`].
    pub fn shared_steps(
        &self,
        snapshot: Option<&Snapshot>,
    ) -> Result<Vec<SharedSteps>, MatchError> {
        let schema = self.schema_in(snapshot);
        let schema = schema.as_ref();
        let mut by_label: BTreeMap<LabelId, Vec<Member>> = BTreeMap::new();
        let rules = self.rules.iter().enumerate();
        for (index, rule) in rules.filter(|(_, rule)| rule.left.edges.len() <= LINKS) {
            let query = Arc::new(self.rule_query(schema, rule)?);
            let statistics = Statistics::known(snapshot, &query)?;
            for trigger in Triggers::of(&query).edges {
                if let (true, &Anchor::Slot(from), &Anchor::Slot(to)) =
                    (trigger.makes, &trigger.from, &trigger.to)
                    && from != to
                {
                    let order = plan(&query, &statistics, &[from.min(to), from.max(to)]);
                    let order = Arc::new(order);
                    let member = Member::new(index, Arc::clone(&query), order, &[from, to]);
                    by_label.entry(trigger.label).or_default().push(member);
                }
            }
        }
        let mut all = Vec::new();
        for (label, members) in by_label {
            let shared = Shared::new(members);
            for branch in 0..shared.branches.len() {
                let found = self.steps_of(&shared, branch, (label, schema));
                all.extend(found);
            }
        }
        Ok(all)
    }

    /// The steps up to a branch that several rules have in common, unless all of them go on alike.
    fn steps_of(
        &self,
        shared: &Shared,
        branch: usize,
        (label, schema): (LabelId, &Schema),
    ) -> Option<SharedSteps> {
        let rules_of = |branch: usize| -> BTreeSet<usize> {
            let through = shared.branches[branch].through.iter();
            through
                .map(|&member| shared.members[member].pattern)
                .collect()
        };
        let rules = rules_of(branch);
        let goes_on = shared.after(branch).any(|next| {
            matches!(shared.branches[next].part, Part::Step(_)) && rules_of(next) == rules
        });
        let Part::Step(last) = shared.branches[branch].part else {
            return None;
        };
        if rules.len() < 2 || goes_on {
            return None;
        }
        let member = &shared.members[*shared.branches[branch].through.first()?];
        let rule: &Rule = self.rules.get(member.pattern)?;
        let (query, plan) = (&*member.query, &*member.plan);
        let words = Words {
            rule,
            query,
            schema,
        };
        let variable = |slot: usize| query.variables[slot].as_str();
        let given: Vec<&str> = member.given().iter().map(|&slot| variable(slot)).collect();
        let mut steps = vec![format!("given {}", given.join(" "))];
        for step in &plan.steps[..=last] {
            let binds: Vec<&str> = step.binds.into_iter().flatten().map(variable).collect();
            let checks = words.checks(step.links.iter().map(|(link, _)| *link), &[]);
            let checks = checks.iter().map(|check| format!(" if {check}"));
            let source = words.source(step.source);
            let checks: String = checks.collect();
            steps.push(format!("{} from {source}{checks}", binds.join(" ")));
        }
        let names = rules.iter().map(|&rule| self.rules[rule].name.to_string());
        Some(SharedSteps {
            label: schema.label_name(label).to_owned(),
            rules: names.collect(),
            steps,
        })
    }
}
