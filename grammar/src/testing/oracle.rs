//! The meaning of rules written down naively: a graph of maps, every assignment tried, every
//! formula evaluated as the language reference reads. Slow, and independent of the matcher.
#![allow(
    clippy::float_cmp,
    reason = "small whole numbers and their quotients compare exactly"
)]

mod rewrite;

use crate::{
    Arithmetic, AttributePath, Comparison, Condition, Expression, Literal, Pattern, PatternNode,
    Rule,
};
use dsr::{Graph, Schema, Time, Transaction, Value};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// What the schema and the grammar's types block say together: each type's parents.
const PARENTS: [(&str, &[&str]); 7] = [
    ("thing", &[]),
    ("box", &["thing", "gear"]),
    ("cup", &["thing", "box"]),
    ("mug", &["cup"]),
    ("tool", &["gear"]),
    ("pot", &["box", "tool"]),
    ("gear", &[]),
];
/// All but `gear`, which only the grammar knows.
pub(crate) const NODE_TYPES: [&str; 6] = ["thing", "box", "cup", "mug", "tool", "pot"];
/// Of these, what the types block adds to the schema.
pub(crate) const TYPES: &str = "name=t\n===\ntypes {\n(thing gear)\n(cup : box)\n(mug : cup)\n\
                                (box : thing gear)\n(tool : gear)\n(pot : tool)\n}\n===\n";
const SCHEMA: &str = "open = true\n[types]\nthing = []\nbox = [\"thing\"]\ncup = [\"thing\"]\n\
                      mug = []\ntool = []\npot = [\"box\", \"tool\"]\n";
/// Subtypes by the schema alone.
const SCHEMA_SUBTYPES: [(&str, &[&str]); 3] = [
    ("thing", &["box", "cup", "pot"]),
    ("box", &["pot"]),
    ("tool", &["pot"]),
];

/// Texts that attributes have and rules ask for.
pub(crate) const TEXTS: &[&str] = &["x", "y"];

pub(crate) type LinkKey = (String, String, String);
/// Variables and the names of their nodes.
pub(crate) type Assignment = BTreeMap<String, String>;

/// The value of an attribute. Numbers are one kind here: whole ones and others compare as reals.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Datum {
    Number(f64),
    Text(String),
    Truth(bool),
}

impl Datum {
    fn strategy() -> impl Strategy<Value = Self> {
        prop_oneof![
            6 => (-2..5_i32).prop_map(|number| Self::Number(number.into())),
            1 => prop::sample::select(TEXTS).prop_map(|text| Self::Text(text.to_owned())),
            1 => any::<bool>().prop_map(Self::Truth),
        ]
    }

    fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Text(_) | Self::Truth(_) => None,
        }
    }

    fn to_value(&self) -> Value {
        match self {
            Self::Number(number) if number.fract() == 0.0 => (*number as i64).into(),
            Self::Number(number) => (*number).into(),
            Self::Text(text) => text.as_str().into(),
            Self::Truth(truth) => (*truth).into(),
        }
    }

    fn of_value(value: &Value) -> Self {
        match value {
            Value::String(text) => Self::Text(text.clone()),
            Value::Bool(truth) => Self::Truth(*truth),
            number => Self::Number(number.as_f64().unwrap()),
        }
    }
}

#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Model {
    pub(crate) nodes: BTreeMap<String, String>,
    pub(crate) links: BTreeSet<LinkKey>,
    /// Attributes of nodes.
    pub(crate) values: BTreeMap<(String, String), Datum>,
    pub(crate) link_values: BTreeMap<(LinkKey, String), Datum>,
}

fn is_a(type_name: &str, general: &str) -> bool {
    type_name == general
        || PARENTS
            .iter()
            .filter(|(name, _)| *name == type_name)
            .flat_map(|(_, parents)| *parents)
            .any(|parent| is_a(parent, general))
}

impl Model {
    pub(crate) fn strategy() -> impl Strategy<Value = Self> {
        let types = prop::collection::vec(0..NODE_TYPES.len(), 0..6);
        let ends = || (0..6_usize, 0..2_usize, 0..6_usize);
        let links = prop::collection::vec((ends(), prop::option::of(Datum::strategy())), 0..14);
        let values = prop::collection::vec((0..6_usize, 0..2_usize, Datum::strategy()), 0..8);
        (types, links, values).prop_map(|(types, links, values)| {
            let mut model = Self::default();
            let node = |index: usize| format!("node{index}");
            for (index, type_index) in types.iter().enumerate() {
                model
                    .nodes
                    .insert(node(index), NODE_TYPES[*type_index].to_owned());
            }
            for ((from, label, to), value) in links {
                let label = ["on", "by"][label].to_owned();
                if from < types.len() && to < types.len() {
                    let key = (node(from), label, node(to));
                    if let Some(value) = value {
                        model.link_values.insert((key.clone(), "n".into()), value);
                    }
                    model.links.insert(key);
                }
            }
            for (index, attribute, value) in values {
                if index < types.len() {
                    let attribute = ["n", "m"][attribute].to_owned();
                    model.values.insert((node(index), attribute), value);
                }
            }
            model
        })
    }

    pub(crate) fn to_graph(&self) -> Graph {
        let mut graph = Graph::in_memory(Schema::from_toml("schema", SCHEMA).unwrap());
        let mut transaction = Transaction::new();
        for (name, type_name) in &self.nodes {
            transaction.create_node(type_name, name, vec![]);
        }
        for (from, label, to) in &self.links {
            transaction.create_edge(from.as_str(), label, to.as_str());
        }
        for ((node, attribute), value) in &self.values {
            transaction.set(node.as_str(), attribute, value.to_value());
        }
        for (((from, label, to), attribute), value) in &self.link_values {
            let edge = dsr::EdgeRef::new(from.as_str(), label, to.as_str());
            transaction.set_on_edge(edge, attribute, value.to_value());
        }
        graph.commit(&transaction, "test", Time::default()).unwrap();
        graph
    }

    pub(crate) fn of_graph(graph: &Graph) -> Self {
        let snapshot = graph.snapshot();
        let schema = snapshot.schema();
        let name = |id| snapshot.find_node(id).unwrap().unwrap().name().unwrap();
        let mut model = Self::default();
        for node in snapshot.nodes() {
            let node = node.unwrap();
            let this = node.name().unwrap();
            for attribute in node.attributes().unwrap() {
                let key = schema.attribute_name(attribute.name).to_owned();
                model
                    .values
                    .insert((this.clone(), key), Datum::of_value(&attribute.value));
            }
            for key in node.out_edges() {
                let key = key.unwrap();
                let link = (
                    this.clone(),
                    schema.label_name(key.label).to_owned(),
                    name(key.to),
                );
                for attribute in snapshot
                    .find_edge(key)
                    .unwrap()
                    .unwrap()
                    .attributes()
                    .unwrap()
                {
                    let key = schema.attribute_name(attribute.name).to_owned();
                    model
                        .link_values
                        .insert((link.clone(), key), Datum::of_value(&attribute.value));
                }
                model.links.insert(link);
            }
            model.nodes.insert(this, node.type_name().to_owned());
        }
        model
    }

    fn of_type(&self, type_name: &str) -> Vec<String> {
        let nodes = self.nodes.iter().filter(|(_, of)| is_a(of, type_name));
        nodes.map(|(name, _)| name.clone()).collect()
    }

    fn has(&self, from: &str, label: &str, to: &str) -> bool {
        self.links.contains(&(from.into(), label.into(), to.into()))
    }

    /// Every assignment of nodes to the rule's variables, matching or not.
    pub(crate) fn assignments(&self, rule: &Rule) -> Vec<Assignment> {
        let mut all = vec![Assignment::new()];
        for node in rule.bound_nodes() {
            let extended = all.iter().flat_map(|assignment| {
                self.nodes.keys().map(|name| {
                    let mut assignment = assignment.clone();
                    assignment.insert(node.variable.to_string(), name.clone());
                    assignment
                })
            });
            all = extended.collect();
        }
        all
    }

    pub(crate) fn rule_holds(&self, rule: &Rule, at: &Assignment) -> bool {
        let distinct: BTreeSet<&String> = at.values().collect();
        let typed = |nodes: &[PatternNode]| {
            nodes
                .iter()
                .all(|node| is_a(&self.nodes[&at[&*node.variable]], &node.type_name))
        };
        distinct.len() == at.len()
            && typed(&rule.left.nodes)
            && typed(&rule.parameters)
            && self.links_hold(&rule.left, at)
            && rule
                .precondition
                .as_ref()
                .is_none_or(|condition| self.holds(condition, at))
    }

    fn links_hold(&self, pattern: &Pattern, at: &Assignment) -> bool {
        pattern
            .edges
            .iter()
            .all(|edge| self.has(&at[&*edge.from], &edge.label, &at[&*edge.to]) != edge.negated)
    }

    fn choices(&self, variables: &[PatternNode], at: &Assignment) -> Vec<Assignment> {
        let mut all = vec![at.clone()];
        for variable in variables {
            let extended = all.iter().flat_map(|assignment| {
                self.of_type(&variable.type_name).into_iter().map(|name| {
                    let mut assignment = assignment.clone();
                    assignment.insert(variable.variable.to_string(), name);
                    assignment
                })
            });
            all = extended.collect();
        }
        all
    }

    fn holds(&self, condition: &Condition, at: &Assignment) -> bool {
        match condition {
            Condition::Edge { label, from, to } => self.has(&at[&**from], label, &at[&**to]),
            Condition::Same(a, b) => at[&**a] == at[&**b],
            Condition::Compare {
                operator,
                left,
                right,
            } => {
                let (Some(left), Some(right)) = (self.value(left, at), self.value(right, at))
                else {
                    return false;
                };
                let ordered = |holds: fn(&f64, &f64) -> bool| {
                    let both = left.number().zip(right.number());
                    both.is_some_and(|(left, right)| holds(&left, &right))
                };
                match operator {
                    Comparison::Equal => left == right,
                    Comparison::NotEqual => left != right,
                    Comparison::Less => ordered(f64::lt),
                    Comparison::LessOrEqual => ordered(f64::le),
                    Comparison::Greater => ordered(f64::gt),
                    Comparison::GreaterOrEqual => ordered(f64::ge),
                }
            }
            Condition::Not(inner) => !self.holds(inner, at),
            Condition::And(all) => all.iter().all(|inner| self.holds(inner, at)),
            Condition::Or(any) => any.iter().any(|inner| self.holds(inner, at)),
            Condition::Exists { variables, body } => self
                .choices(variables, at)
                .iter()
                .any(|choice| self.holds(body, choice)),
            Condition::Forall { variables, body } => self
                .choices(variables, at)
                .iter()
                .all(|choice| self.holds(body, choice)),
            Condition::When {
                condition,
                consequence,
            } => !self.holds(condition, at) || self.holds(consequence, at),
        }
    }

    fn value(&self, expression: &Expression, at: &Assignment) -> Option<Datum> {
        match expression {
            Expression::Literal(literal) => Some(match literal {
                Literal::Integer(value) => Datum::Number(*value as f64),
                Literal::Large(value) => Datum::Number(*value as f64),
                Literal::Real(value) => Datum::Number(*value),
                Literal::Text(text) => Datum::Text(text.clone()),
                Literal::Boolean(truth) => Datum::Truth(*truth),
            }),
            Expression::Attribute(AttributePath::Node {
                variable,
                attribute,
            }) => self
                .values
                .get(&(at[&**variable].clone(), attribute.to_string()))
                .cloned(),
            Expression::Attribute(AttributePath::Edge {
                from,
                label,
                to,
                attribute,
            }) => {
                let link = (at[&**from].clone(), label.to_string(), at[&**to].clone());
                self.link_values
                    .get(&(link, attribute.to_string()))
                    .cloned()
            }
            Expression::Arithmetic { operator, operands } => {
                let values: Option<Vec<f64>> = operands
                    .iter()
                    .map(|operand| self.value(operand, at)?.number())
                    .collect();
                let result = match (&values?[..], operator) {
                    ([only], _) => Some(-only),
                    (all, Arithmetic::Add) => Some(all.iter().sum()),
                    (all, Arithmetic::Multiply) => Some(all.iter().product()),
                    ([first, rest @ ..], Arithmetic::Subtract) => {
                        Some(first - rest.iter().sum::<f64>())
                    }
                    ([first, rest @ ..], Arithmetic::Divide) => rest
                        .iter()
                        .try_fold(*first, |sum, next| (*next != 0.0).then(|| sum / next)),
                    ([], _) => None,
                };
                result.map(Datum::Number)
            }
        }
    }
}
