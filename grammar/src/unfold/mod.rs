//! Combos as ordinary rules, and hierarchical rules as goals.
//!
//! Guarantee: an unfolded rule matches where the combo's steps can be applied one after another,
//! and changes what they change; a combo of which that cannot be said in one rule is reported, not
//! approximated.

mod compose;
mod consistent;
mod regress;
#[cfg(test)]
mod tests;
mod whole;

use crate::parser::Finding;
use crate::rename::Renaming;
use crate::{
    Binding, Combo, ComboStep, Constant, Expression, Goal, Grammar, Name, PatternEdge, Problem,
    Rule,
};
use compose::{Composition, Impossible};
use dsr::{ReadError, Snapshot};
use std::collections::{BTreeMap, BTreeSet};

/// How many steps of one combo may be optional: each doubles the rules it stands for.
pub const OPTIONAL_LIMIT: usize = 6;

/// An ordinary rule that a combo stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct Unfolded {
    /// The steps in one. Called as the combo where no step is left out, else
    /// `COMBO_without_ALIAS...`.
    pub rule: Rule,
    /// The combo.
    pub combo: Name,
    /// What it is made of, in the order they are carried out.
    pub steps: Vec<UnfoldedStep>,
}

/// A rule as a part of an unfolded one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnfoldedStep {
    /// The rule.
    pub rule: Name,
    /// What the combo calls this use of it.
    pub alias: Name,
    /// Each variable that the rule binds or creates by its sides, and the one that stands for it
    /// in the unfolded rule.
    pub variables: Vec<(Name, Name)>,
}

impl UnfoldedStep {
    /// The binding of this step's rule, given one of the unfolded rule. Nodes that an earlier step
    /// creates are not bound yet.
    pub fn binding(&self, whole: &Binding) -> Binding {
        let bound = |(own, unfolded): &(Name, Name)| Some((own.clone(), whole.get(unfolded)?));
        self.variables.iter().filter_map(bound).collect()
    }
}

/// The rules that every combo of the grammar stands for, and what stands in the way of others.
pub(crate) fn unfold(grammar: &Grammar) -> (Vec<Unfolded>, Vec<Finding>) {
    let mut unfolded: Vec<Unfolded> = Vec::new();
    let mut findings = Vec::new();
    for combo in &grammar.combos {
        let mut report_at = |at: &Name, problem| {
            findings.push(Finding {
                span: at.span(),
                problem,
                related: None,
            });
        };
        let mut report = |problem| report_at(&combo.name, problem);
        let known = |step: &ComboStep| grammar.own_rule(&step.rule).is_some();
        if !combo.steps.iter().all(known) {
            // A step that is no rule is reported where it stands; one that is a combo is not.
            let nested = combo
                .steps
                .iter()
                .find(|s| grammar.combos.iter().any(|c| c.name == s.rule));
            if let Some(step) = nested {
                let reason = format!("its step `{}` is a combo itself", step.alias);
                report(Problem::NotUnfolded { reason });
            }
            continue;
        }
        let optional = combo.steps.iter().filter(|step| step.optional).count();
        if optional > OPTIONAL_LIMIT {
            let reason = format!("more than {OPTIONAL_LIMIT} of its steps are optional");
            report(Problem::NotUnfolded { reason });
            continue;
        }
        let mut some = false;
        let mut first = None;
        for steps in choices(&combo.steps) {
            match variant(grammar, combo, &steps) {
                Ok(rule) => {
                    some = true;
                    if grammar.own_rule(&rule.rule.name).is_none()
                        && !unfolded.iter().any(|u| u.rule.name == rule.rule.name)
                    {
                        unfolded.push(rule);
                    }
                }
                Err(Broken { reason, step }) => {
                    let whole = steps.len() == combo.steps.len();
                    first.get_or_insert((reason.0, step, whole));
                }
            }
        }
        // That a step does not fit some choice of the others is what makes it optional; the choice of all comes first.
        match first {
            Some((reason, ..)) if !some => report(Problem::NotUnfolded { reason }),
            Some((reason, step, true)) => {
                report_at(&combo.steps[step].alias, Problem::NeverWhole { reason });
            }
            _ => {}
        }
    }
    (unfolded, findings)
}

/// Every choice of steps: all first, then with optional ones left out. Never none at all.
fn choices(steps: &[ComboStep]) -> Vec<Vec<&ComboStep>> {
    let mut all: Vec<Vec<&ComboStep>> = vec![Vec::new()];
    for step in steps {
        let with = all.iter().map(|chosen| {
            let mut chosen = chosen.clone();
            chosen.push(step);
            chosen
        });
        let with: Vec<_> = with.collect();
        if step.optional {
            // With the step come first.
            all = with.into_iter().chain(all).collect();
        } else {
            all = with;
        }
    }
    all.retain(|chosen| !chosen.is_empty());
    all
}

/// Variables of the chosen steps that stand for one node, and what the unfolded rule calls it.
struct Classes<'a> {
    classes: Vec<(Vec<(usize, &'a Name)>, Name)>,
}

impl<'a> Classes<'a> {
    fn new(grammar: &'a Grammar, combo: &'a Combo, steps: &[&'a ComboStep]) -> Self {
        let mut classes: Vec<Vec<(usize, &Name)>> = Vec::new();
        for (index, step) in steps.iter().enumerate() {
            let Some(rule) = grammar.own_rule(&step.rule) else {
                continue;
            };
            for node in rule.bound_nodes().chain(&rule.right.nodes) {
                let member = (index, &node.variable);
                if !classes.iter().flatten().any(|known| *known == member) {
                    classes.push(vec![member]);
                }
            }
        }
        for equality in &combo.equalities {
            // A step that is left out takes no part in it.
            let members: Vec<(usize, &Name)> = equality
                .iter()
                .filter_map(|part| {
                    let step = steps.iter().position(|step| step.alias == part.alias)?;
                    Some((step, &part.variable))
                })
                .collect();
            let is_of = |class: &Vec<(usize, &Name)>| members.iter().any(|m| class.contains(m));
            if let Some(first) = classes.iter().position(is_of) {
                let (same, others): (Vec<_>, Vec<_>) =
                    classes.into_iter().partition(|class| is_of(class));
                classes = others;
                classes.insert(first, same.into_iter().flatten().collect());
            }
        }
        let mut names: BTreeSet<String> = BTreeSet::new();
        let mut named = Vec::new();
        for class in classes {
            let (step, variable) = class[0];
            let mut name = variable.to_string();
            if names.contains(&name) {
                name = format!("{}_{variable}", steps[step].alias);
            }
            while names.contains(&name) {
                name.push('_');
            }
            names.insert(name.clone());
            named.push((class, Name::new(name, variable.span())));
        }
        Self { classes: named }
    }

    fn of_step(&self, step: usize) -> Result<Vec<(Name, Name)>, Impossible> {
        let mut variables: Vec<(Name, Name)> = Vec::new();
        for (class, name) in &self.classes {
            let mut own = class.iter().filter(|(of, _)| *of == step);
            if let Some((_, variable)) = own.next() {
                variables.push(((*variable).clone(), name.clone()));
            }
            if let (Some((_, again)), Some((first, _))) = (own.next(), variables.last()) {
                return Err(Impossible(format!(
                    "`{first}` and `{again}` of one step would be one node"
                )));
            }
        }
        Ok(variables)
    }
}

/// Why chosen steps are no rule, and the place among them of the one that does not fit.
struct Broken {
    reason: Impossible,
    step: usize,
}

fn variant(grammar: &Grammar, combo: &Combo, steps: &[&ComboStep]) -> Result<Unfolded, Broken> {
    let at = |step| move |reason| Broken { reason, step };
    let classes = Classes::new(grammar, combo, steps);
    let mut taken: BTreeSet<String> = classes.classes.iter().map(|c| c.1.to_string()).collect();
    let mut composition = Composition::new(&grammar.types);
    let mut unfolded_steps = Vec::new();
    let mut parts = Vec::new();
    for (index, step) in steps.iter().enumerate() {
        let Some(rule) = grammar.own_rule(&step.rule) else {
            continue;
        };
        let variables = classes.of_step(index).map_err(at(index))?;
        let part = Renaming::new(variables.clone(), &mut taken, &step.alias).rule(rule);
        let last = index + 1 == steps.len();
        let made = composition.step(&part, &step.alias, last);
        made.map_err(at(index))?;
        unfolded_steps.push(UnfoldedStep {
            rule: step.rule.clone(),
            alias: step.alias.clone(),
            variables,
        });
        parts.push(rule);
    }
    let left_out: Vec<&str> = combo
        .steps
        .iter()
        .filter(|step| !steps.iter().any(|chosen| chosen.alias == step.alias))
        .map(|step| &*step.alias)
        .collect();
    let name = if left_out.is_empty() {
        combo.name.clone()
    } else {
        let name = format!("{}_without_{}", combo.name, left_out.join("_"));
        Name::new(name, combo.name.span())
    };
    let agent = parts.first().and_then(|rule| rule.agent.clone());
    let mut activates: Vec<Name> = Vec::new();
    for name in parts.iter().flat_map(|rule| &rule.activates) {
        if !activates.contains(name) {
            activates.push(name.clone());
        }
    }
    let mut rule = composition.finish().map_err(at(steps.len() - 1))?;
    rule.name = name;
    rule.kind = combo.kind;
    rule.cost = Expression::number(combo.cost);
    rule.success = parts.iter().map(|rule| rule.success).product();
    rule.agent = agent.filter(|agent| parts.iter().all(|r| r.agent.as_ref() == Some(agent)));
    rule.activates = activates;
    rule.comments.clone_from(&combo.comments);
    Ok(Unfolded {
        rule,
        combo: combo.name.clone(),
        steps: unfolded_steps,
    })
}

impl Grammar {
    /// What a rule aims at from a binding of its left side, as a goal: its right side with the kept
    /// nodes for constants and the created ones for variables, the links that it takes away
    /// starred. Effect blocks and deleted nodes are no part of it.
    ///
    /// This is how a `hierarchical` rule is unfolded: it is not carried out itself; a plan of other
    /// rules brings about what it says.
    ///
    /// # Errors
    /// [`ReadError`] where the snapshot cannot be read any more.
    ///
    /// # Example
    /// ```
    /// let (grammar, _) = grammar::parse_grammar(
    ///     "name=x\n===\nhierarchical tidy : active(9) {
    ///         { c:cup t:table s:shelf c->t(on) } => { c:cup t:table s:shelf c->s(on) } }\n",
    ///     "x.aggl",
    /// );
    /// let mut graph = dsr::Graph::in_memory(dsr::Schema::open());
    /// let mut world = dsr::Transaction::new();
    /// for (kind, name) in [("cup", "mine"), ("table", "desk"), ("shelf", "rack")] {
    ///     world.create_node(kind, name, vec![]);
    /// }
    /// world.create_edge("mine", "on", "desk");
    /// graph.commit(&world, "me", dsr::Time::default())?;
    /// let snapshot = graph.snapshot();
    /// let rule = grammar.rule("tidy").ok_or("no such rule")?;
    /// let found = grammar.matches(&snapshot, rule, &grammar::Binding::new())?.next();
    /// let goal = grammar.subgoal(&snapshot, rule, &found.ok_or("no match")??)?;
    /// assert!(goal.to_string().contains("\"mine\"->\"rack\"(on)"));
    /// assert!(grammar.goal_holds(&snapshot, &goal)?.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn subgoal(
        &self,
        snapshot: &Snapshot,
        rule: &Rule,
        binding: &Binding,
    ) -> Result<Goal, ReadError> {
        let mut goal = Goal::default();
        let mut names: BTreeMap<&Name, Name> = BTreeMap::new();
        let extra = rule
            .parameters
            .iter()
            .filter(|p| rule.left.node(&p.variable).is_none());
        for node in rule.right.nodes.iter().chain(extra) {
            if names.contains_key(&node.variable) {
                continue;
            }
            let bound = match binding.get(&node.variable) {
                Some(id) => snapshot.find_node(id)?,
                None => None,
            };
            let variable = match bound {
                Some(found) => {
                    let name = found.name()?;
                    let quoted = crate::lexer::quote(&name);
                    goal.constants.insert(quoted.clone(), Constant::Name(name));
                    Name::from(quoted.as_str())
                }
                None => node.variable.clone(),
            };
            names.insert(&node.variable, variable.clone());
            goal.pattern
                .nodes
                .push(crate::PatternNode::new(variable, node.type_name.clone()));
        }
        let gone = rule.left.edges.iter().filter(|edge| {
            !edge.negated && rule.right.edge(&edge.from, &edge.label, &edge.to).is_none()
        });
        let gone = gone.map(|edge| (edge, true));
        let there = rule.right.edges.iter().map(|edge| (edge, edge.negated));
        for (edge, negated) in there.chain(gone) {
            if let (Some(from), Some(to)) = (names.get(&edge.from), names.get(&edge.to)) {
                goal.pattern.edges.push(PatternEdge {
                    from: from.clone(),
                    label: edge.label.clone(),
                    to: to.clone(),
                    negated,
                });
            }
        }
        Ok(goal)
    }
}
