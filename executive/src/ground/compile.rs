//! From a grammar and a goal to a [`Program`]. This file guarantees that each part of a rule keeps
//! the meaning that the grammar's own application gives it; rules that it cannot do justice to are
//! left out and noted.

use super::program::{Change, Link, Operator, Place, Program, Quantified, Term, Test, Variable};
use super::vocabulary::{TypeSet, Vocabulary};
use dsr::Schema;
use grammar::{
    AttributePath, Condition, Effect, Expression, Goal, Grammar, Kind, Name, Pattern, PatternEdge,
    PatternNode, Rule, Types,
};

/// Why a rule or goal cannot be compiled.
pub(super) type Reason = String;

struct Scope<'a> {
    vocabulary: &'a mut Vocabulary,
    types: &'a Types,
    schema: &'a Schema,
    names: Vec<Name>,
    most: usize,
}

impl Scope<'_> {
    fn declare(&mut self, name: &Name) -> usize {
        self.names.push(name.clone());
        self.most = self.most.max(self.names.len());
        self.names.len() - 1
    }

    fn slot(&self, name: &Name) -> Result<u32, Reason> {
        let found = self.names.iter().rposition(|known| known == name);
        found
            .map(|slot| slot as u32)
            .ok_or_else(|| format!("no variable `{name}` is in scope"))
    }

    fn type_set(&self, name: &str) -> TypeSet {
        self.vocabulary.type_set(self.types, self.schema, name)
    }

    fn link(&mut self, label: &str, from: &Name, to: &Name) -> Result<Link, Reason> {
        Ok(Link {
            label: self.vocabulary.labels.intern(label),
            from: self.slot(from)?,
            to: self.slot(to)?,
        })
    }

    fn edge(&mut self, edge: &PatternEdge) -> Result<Link, Reason> {
        self.link(&edge.label, &edge.from, &edge.to)
    }

    fn place(&mut self, path: &AttributePath) -> Result<Place, Reason> {
        Ok(match path {
            AttributePath::Node {
                variable,
                attribute,
            } => Place::Node(
                self.slot(variable)?,
                self.vocabulary.attributes.intern(attribute),
            ),
            AttributePath::Edge {
                from,
                label,
                to,
                attribute,
            } => Place::Link(
                self.link(label, from, to)?,
                self.vocabulary.attributes.intern(attribute),
            ),
        })
    }

    fn term(&mut self, expression: &Expression) -> Result<Term, Reason> {
        Ok(match expression {
            Expression::Literal(literal) => Term::Constant(literal.value()),
            Expression::Attribute(path) => Term::Place(self.place(path)?),
            Expression::Arithmetic { operator, operands } => Term::Arithmetic(
                *operator,
                operands
                    .iter()
                    .map(|operand| self.term(operand))
                    .collect::<Result<_, _>>()?,
            ),
        })
    }

    /// Compiles `body` with the variables in scope.
    fn quantified<T>(
        &mut self,
        variables: &[PatternNode],
        body: impl FnOnce(&mut Self) -> Result<T, Reason>,
    ) -> Result<Quantified<T>, Reason> {
        let first = self.names.len();
        let domains = variables
            .iter()
            .map(|node| {
                self.declare(&node.variable);
                self.type_set(&node.type_name)
            })
            .collect();
        let body = body(self);
        self.names.truncate(first);
        Ok(Quantified {
            first,
            domains,
            body: body?,
        })
    }

    fn tests(&mut self, conditions: &[Condition]) -> Result<Vec<Test>, Reason> {
        conditions.iter().map(|c| self.test(c)).collect()
    }

    fn test(&mut self, condition: &Condition) -> Result<Test, Reason> {
        Ok(match condition {
            Condition::Edge { label, from, to } => Test::Link(self.link(label, from, to)?),
            Condition::Same(first, second) => Test::Same(self.slot(first)?, self.slot(second)?),
            Condition::Compare {
                operator,
                left,
                right,
            } => Test::Compare(*operator, self.term(left)?, self.term(right)?),
            Condition::Not(inner) => Test::Not(Box::new(self.test(inner)?)),
            Condition::And(all) => Test::All(self.tests(all)?),
            Condition::Or(any) => Test::Any(self.tests(any)?),
            Condition::Exists { variables, body } => {
                Test::Exists(self.quantified(variables, |s| Ok(Box::new(s.test(body)?)))?)
            }
            Condition::Forall { variables, body } => {
                Test::Forall(self.quantified(variables, |s| Ok(Box::new(s.test(body)?)))?)
            }
            Condition::When {
                condition,
                consequence,
            } => {
                let unless = Test::Not(Box::new(self.test(condition)?));
                Test::Any(vec![unless, self.test(consequence)?])
            }
        })
    }

    fn effects(&mut self, effects: &[Effect]) -> Result<Vec<Change>, Reason> {
        effects.iter().map(|effect| self.effect(effect)).collect()
    }

    fn effect(&mut self, effect: &Effect) -> Result<Change, Reason> {
        Ok(match effect {
            Effect::Link { label, from, to } => Change::Link(self.link(label, from, to)?),
            Effect::Unlink { label, from, to } => Change::Unlink(self.link(label, from, to)?),
            Effect::Assign { target, value } => {
                Change::Assign(self.place(target)?, self.term(value)?)
            }
            Effect::Create { .. } => return Err("it creates nodes under a condition".to_owned()),
            Effect::Delete { variable } => Change::Delete(self.slot(variable)?),
            Effect::Retype {
                variable,
                type_name,
            } => Change::Retype(
                self.slot(variable)?,
                self.vocabulary.types.intern(type_name),
            ),
            Effect::Forall { variables, body } => {
                Change::Forall(self.quantified(variables, |s| s.effects(body))?)
            }
            Effect::When { condition, body } => {
                Change::When(self.test(condition)?, self.effects(body)?)
            }
        })
    }
}

/// The conditions that must all hold for this one to hold.
fn conjuncts(condition: &Condition) -> Vec<&Condition> {
    match condition {
        Condition::And(all) => all.iter().flat_map(conjuncts).collect(),
        other => vec![other],
    }
}

/// What a pattern and a condition demand, into an operator that does nothing yet.
fn demand(
    scope: &mut Scope<'_>,
    nodes: &[&PatternNode],
    narrowed: &[PatternNode],
    pattern: &Pattern,
    condition: Option<&Condition>,
) -> Result<Operator, Reason> {
    let mut variables = Vec::new();
    for node in nodes {
        scope.declare(&node.variable);
        let mut types = scope.type_set(&node.type_name);
        for also in narrowed.iter().filter(|n| n.variable == node.variable) {
            types.intersect_with(&scope.type_set(&also.type_name));
        }
        let name = node.variable.to_string();
        variables.push(Variable { name, types });
    }
    let (mut links, mut absent, mut tests) = (Vec::new(), Vec::new(), Vec::new());
    for edge in &pattern.edges {
        let link = scope.edge(edge)?;
        if edge.negated {
            absent.push(link);
        } else {
            links.push(link);
        }
    }
    for condition in condition.into_iter().flat_map(conjuncts) {
        match scope.test(condition)? {
            // What must be there anyway guides the search for bindings, too.
            Test::Link(link) => links.push(link),
            test => tests.push(test),
        }
    }
    Ok(Operator {
        name: String::new(),
        bound: variables.len(),
        variables,
        fixed: Vec::new(),
        slots: 0,
        links,
        absent,
        tests,
        changes: Vec::new(),
        cost: Term::Constant(0.0.into()),
        success: 1.0,
        agent: None,
        dormant: false,
        wakes: Vec::new(),
        strict: false,
    })
}

fn compile_rule(scope: &mut Scope<'_>, rule: &Rule) -> Result<Operator, Reason> {
    let bound: Vec<&PatternNode> = rule.bound_nodes().collect();
    let condition = rule.precondition.as_ref();
    let mut operator = demand(scope, &bound, &rule.parameters, &rule.left, condition)?;
    operator.name = rule.name.to_string();
    operator.cost = scope.term(&rule.cost)?;
    operator.success = rule.success;
    operator.agent = rule.agent.as_ref().map(ToString::to_string);
    operator.dormant = rule.dormant;
    operator.strict = rule.strict;
    let on_left = |node: &PatternNode| bound.iter().find(|b| b.variable == node.variable);
    for node in &rule.right.nodes {
        match on_left(node) {
            None => create(scope, &mut operator, &node.variable, &node.type_name),
            Some(left) if left.type_name != node.type_name => {
                let slot = scope.slot(&node.variable)?;
                let number = scope.vocabulary.types.intern(&node.type_name);
                operator.changes.push(Change::Retype(slot, number));
            }
            Some(_) => {}
        }
    }
    for node in &rule.left.nodes {
        if rule.right.node(&node.variable).is_none() {
            let slot = scope.slot(&node.variable)?;
            operator.changes.push(Change::Delete(slot));
        }
    }
    for edge in rule.left.edges.iter().filter(|edge| !edge.negated) {
        let kept = rule.right.edge(&edge.from, &edge.label, &edge.to);
        if kept.is_none_or(|kept| kept.negated) {
            operator.changes.push(Change::Unlink(scope.edge(edge)?));
        }
    }
    for edge in &rule.right.edges {
        let link = scope.edge(edge)?;
        let left = rule.left.edge(&edge.from, &edge.label, &edge.to);
        if edge.negated {
            operator.changes.push(Change::Unlink(link));
        } else if left.is_none_or(|left| left.negated) || may_go(&rule.effect, &edge.label) {
            operator.changes.push(Change::Link(link));
        }
    }
    for effect in &rule.effect {
        if let Effect::Create {
            variable,
            type_name,
        } = effect
        {
            create(scope, &mut operator, variable, type_name);
        } else {
            let change = scope.effect(effect)?;
            operator.changes.push(change);
        }
    }
    operator.slots = scope.most;
    Ok(operator)
}

/// Whether effects may take a link of that label away, so that a kept one must be made anew.
fn may_go(effects: &[Effect], label: &Name) -> bool {
    effects.iter().any(|effect| match effect {
        Effect::Unlink { label: gone, .. } => gone == label,
        Effect::Forall { body, .. } | Effect::When { body, .. } => may_go(body, label),
        _ => false,
    })
}

fn create(scope: &mut Scope<'_>, operator: &mut Operator, variable: &Name, type_name: &str) {
    let slot = scope.declare(variable);
    let number = scope.vocabulary.types.intern(type_name);
    let mut types = TypeSet::with_capacity(scope.vocabulary.types.len());
    types.insert(usize::from(number));
    operator.variables.push(Variable {
        name: variable.to_string(),
        types,
    });
    operator.changes.push(Change::Create(slot as u32, number));
}

/// Interns every type that is named anywhere, so that sets of types are complete.
fn intern_types(vocabulary: &mut Vocabulary, grammar: &Grammar, goal: &Goal, schema: &Schema) {
    for node_type in schema.types() {
        vocabulary.types.intern(&node_type.name);
    }
    for name in grammar.types.names() {
        vocabulary.types.intern(name);
    }
    for rule in &grammar.rules {
        for node in rule.bound_nodes().chain(&rule.right.nodes) {
            vocabulary.types.intern(&node.type_name);
        }
        intern_in_effects(vocabulary, &rule.effect);
    }
    for node in &goal.pattern.nodes {
        vocabulary.types.intern(&node.type_name);
    }
}

fn intern_in_effects(vocabulary: &mut Vocabulary, effects: &[Effect]) {
    for effect in effects {
        match effect {
            Effect::Create { type_name, .. } | Effect::Retype { type_name, .. } => {
                vocabulary.types.intern(type_name);
            }
            Effect::Forall { body, .. } | Effect::When { body, .. } => {
                intern_in_effects(vocabulary, body);
            }
            _ => {}
        }
    }
}

/// Compiles the rules that a plan may use, and the goal (its constants still unbound).
pub(super) fn compile(
    grammar: &Grammar,
    goal: &Goal,
    schema: &Schema,
) -> Result<(Program, Operator), Reason> {
    let mut vocabulary = Vocabulary::default();
    intern_types(&mut vocabulary, grammar, goal, schema);
    let mut operators = Vec::new();
    let mut notes = Vec::new();
    let mut woken = Vec::new();
    for rule in &grammar.rules {
        // A hierarchical rule sums up others, and a passive one happens by itself.
        if rule.kind != Kind::Active || rule.hierarchical {
            continue;
        }
        let mut scope = Scope {
            vocabulary: &mut vocabulary,
            types: &grammar.types,
            schema,
            names: Vec::new(),
            most: 0,
        };
        match compile_rule(&mut scope, rule) {
            Ok(operator) => {
                operators.push(operator);
                woken.push(&rule.activates);
            }
            Err(reason) => notes.push(format!("rule `{}` is not used: {reason}", rule.name)),
        }
    }
    let number = |operators: &[Operator], name: &Name| {
        let same = |operator: &Operator| *name == *operator.name.as_str();
        operators.iter().position(same)
    };
    for (index, names) in woken.into_iter().enumerate() {
        operators[index].wakes = names
            .iter()
            .filter_map(|name| number(&operators, name))
            .collect();
    }
    let mut scope = Scope {
        vocabulary: &mut vocabulary,
        types: &grammar.types,
        schema,
        names: Vec::new(),
        most: 0,
    };
    let nodes: Vec<&PatternNode> = goal.pattern.nodes.iter().collect();
    let condition = goal.precondition.as_ref();
    let mut wanted = demand(&mut scope, &nodes, &[], &goal.pattern, condition)?;
    wanted.slots = scope.most;
    // A strict rule must not leave any link hanging, also of labels that no rule names.
    let strict = operators.iter().any(Operator::is_held_by_links);
    if strict {
        for label in schema.labels() {
            vocabulary.labels.intern(&label.name);
        }
    }
    let mut program = Program {
        strict,
        types: TypeSet::with_capacity(vocabulary.types.len()),
        made: vec![false; vocabulary.labels.len()],
        removed: vec![false; vocabulary.labels.len()],
        types_change: false,
        assigned: vec![false; vocabulary.attributes.len()],
        vocabulary,
        operators,
        notes,
    };
    analyse(&mut program, &wanted);
    Ok((program, wanted))
}

/// Finds what rules may change.
fn analyse(program: &mut Program, goal: &Operator) {
    let mut read = vec![false; program.assigned.len()];
    let mut changes = Vec::new();
    for operator in program.operators.iter().chain([goal]) {
        for variable in &operator.variables {
            program.types.union_with(&variable.types);
        }
        for test in &operator.tests {
            domains_and_reads(test, &mut program.types, &mut read);
        }
        operator
            .cost
            .each_place(&mut |place| read[usize::from(place.attribute())] = true);
        operator.each_change(&mut |change| changes.push(change.clone()));
    }
    for change in &changes {
        match change {
            Change::Link(link) => program.made[usize::from(link.label)] = true,
            Change::Unlink(link) => program.removed[usize::from(link.label)] = true,
            Change::Assign(place, term) => {
                program.assigned[usize::from(place.attribute())] = true;
                term.each_place(&mut |place| read[usize::from(place.attribute())] = true);
            }
            Change::Delete(_) => {
                program.types_change = true;
                program.removed.fill(true);
            }
            Change::Create(..) | Change::Retype(..) => program.types_change = true,
            Change::Forall(quantified) => {
                for domain in &quantified.domains {
                    program.types.union_with(domain);
                }
            }
            Change::When(test, _) => domains_and_reads(test, &mut program.types, &mut read),
        }
    }
    for (assigned, read) in program.assigned.iter_mut().zip(&read) {
        *assigned &= read;
    }
}

fn domains_and_reads(test: &Test, types: &mut TypeSet, read: &mut [bool]) {
    match test {
        Test::Link(_) | Test::Same(..) => {}
        Test::Compare(_, left, right) => {
            for term in [left, right] {
                term.each_place(&mut |place| read[usize::from(place.attribute())] = true);
            }
        }
        Test::Not(inner) => domains_and_reads(inner, types, read),
        Test::All(parts) | Test::Any(parts) => {
            for part in parts {
                domains_and_reads(part, types, read);
            }
        }
        Test::Exists(quantified) | Test::Forall(quantified) => {
            for domain in &quantified.domains {
                types.union_with(domain);
            }
            domains_and_reads(&quantified.body, types, read);
        }
    }
}
