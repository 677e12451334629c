//! A PDDL domain and problem with numbers for names. This file owns what their parts mean; it
//! guarantees nothing by itself: `parse` makes them so that every number stands for something.

use crate::pddl::names::Names;

/// An object, by number.
pub(super) type Object = u32;

/// What stands for an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Term {
    Object(Object),
    /// A parameter or quantified variable, by its place in the environment.
    Slot(usize),
}

impl Term {
    pub(super) fn at(self, environment: &[Object]) -> Object {
        match self {
            Self::Object(object) => object,
            Self::Slot(slot) => environment[slot],
        }
    }
}

/// A predicate with its arguments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Atom {
    pub(super) predicate: usize,
    pub(super) arguments: Vec<Term>,
}

/// Variables that take every choice of objects; their slots follow each other from `first` on.
#[derive(Debug, Clone)]
pub(super) struct Variables {
    pub(super) first: usize,
    /// What each may stand for.
    pub(super) domains: Vec<Vec<Object>>,
}

#[derive(Debug, Clone)]
pub(super) enum Condition {
    Atom(Atom),
    Same(Term, Term),
    Not(Box<Condition>),
    All(Vec<Condition>),
    Any(Vec<Condition>),
    Exists(Variables, Box<Condition>),
    Forall(Variables, Box<Condition>),
}

#[derive(Debug, Clone)]
pub(super) enum Effect {
    Add(Atom),
    Delete(Atom),
    When(Condition, Vec<Effect>),
    Forall(Variables, Vec<Effect>),
}

/// What an action costs.
#[derive(Debug, Clone)]
pub(super) enum Cost {
    Number(f64),
    /// A function, whose values never change.
    Function(usize, Vec<Term>),
    Sum(Vec<Cost>),
    Product(Vec<Cost>),
    Difference(Box<Cost>, Box<Cost>),
    Quotient(Box<Cost>, Box<Cost>),
}

#[derive(Debug, Clone)]
pub(super) struct Action {
    pub(super) name: String,
    pub(super) parameters: Vec<String>,
    pub(super) variables: Variables,
    /// How many slots its quantifiers take at the most, parameters included.
    pub(super) slots: usize,
    pub(super) precondition: Condition,
    pub(super) effects: Vec<Effect>,
    pub(super) cost: Cost,
}

/// What a function is worth at some objects.
pub(super) type Value = (usize, Vec<Object>, f64);

/// A domain and a problem of it.
#[derive(Debug, Clone, Default)]
pub struct Definition {
    pub(super) objects: Names,
    pub(super) predicates: Names,
    pub(super) functions: Names,
    pub(super) actions: Vec<Action>,
    pub(super) initial: Vec<(usize, Vec<Object>)>,
    pub(super) values: Vec<Value>,
    pub(super) goal: Option<Condition>,
    /// Slots of the goal's quantifiers.
    pub(super) goal_slots: usize,
    /// Whether the total cost counts; else every action counts one.
    pub(super) metric: bool,
}

impl Definition {
    /// A predicate, function or action with its arguments, as PDDL writes it.
    pub(super) fn written(&self, name: &str, objects: &[Object]) -> String {
        let objects = objects.iter().map(|&o| self.objects.name(o as usize));
        let words: Vec<&str> = std::iter::once(name).chain(objects).collect();
        format!("({})", words.join(" "))
    }
}
