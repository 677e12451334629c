//! Strategies: random rules, goals and whole grammars, and random small graphs.

use super::oracle::TEXTS;
use crate::{
    Arithmetic, AttributePath, Combo, ComboStep, ComboVariable, Comparison, Condition, Effect,
    Expression, Grammar, Include, Kind, Literal, Name, Pattern, PatternEdge, PatternNode, Property,
    Rule, TypeDeclaration, Types,
};
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proptest::sample::select;

/// Which names and values a strategy draws from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Words {
    pub(crate) variables: &'static [&'static str],
    pub(crate) types: &'static [&'static str],
    pub(crate) labels: &'static [&'static str],
    pub(crate) attributes: &'static [&'static str],
    /// Literals of all kinds, or small whole numbers, two texts and truth values only.
    pub(crate) any_literal: bool,
}

/// Names that the parser could take for something else.
pub(crate) const AWKWARD: Words = Words {
    variables: &[
        "e", "robot", "1", "4th", "true", "effect", "types", "include", "ñandú", "x_1",
    ],
    types: &["active", "passive", "room", "7", "_"],
    labels: &["in", "near_to", "active", "x", "9", "rule"],
    attributes: &["distance", "e", "true", "not"],
    any_literal: true,
};

/// Few names, so that random rules match random graphs often.
pub(crate) const FEW: Words = Words {
    variables: &["a", "b", "c"],
    types: &[
        "thing", "thing", "gear", "gear", "box", "cup", "mug", "tool", "pot",
    ],
    labels: &["on", "by"],
    attributes: &["n", "m"],
    any_literal: false,
};

fn name(pool: &'static [&'static str]) -> impl Strategy<Value = Name> {
    select(pool).prop_map(Name::from)
}

impl Words {
    fn node(self) -> impl Strategy<Value = PatternNode> {
        let position = option::of((-500.0..500.0, -500.0..500.0).prop_map(|(x, y)| [x, y]));
        let position = if self.any_literal {
            position.boxed()
        } else {
            Just(None).boxed()
        };
        (name(self.variables), name(self.types), position).prop_map(|(variable, type_name, p)| {
            PatternNode {
                variable,
                type_name,
                position: p,
            }
        })
    }

    fn quantified(self) -> impl Strategy<Value = PatternNode> {
        self.node().prop_map(|node| PatternNode {
            position: None,
            ..node
        })
    }

    fn edge(self) -> impl Strategy<Value = PatternEdge> {
        let negated = prop::bool::weighted(0.25);
        (
            name(self.variables),
            name(self.labels),
            name(self.variables),
            negated,
        )
            .prop_map(|(from, label, to, negated)| PatternEdge {
                from,
                label,
                to,
                negated,
            })
    }

    pub(crate) fn pattern(self, nodes: usize, edges: usize) -> impl Strategy<Value = Pattern> {
        (vec(self.node(), 0..=nodes), vec(self.edge(), 0..=edges))
            .prop_map(|(nodes, edges)| Pattern { nodes, edges })
    }

    fn literal(self) -> impl Strategy<Value = Literal> {
        if !self.any_literal {
            return prop_oneof![
                6 => (-2..5_i64).prop_map(Literal::Integer),
                1 => select(TEXTS).prop_map(|text| Literal::Text(text.to_owned())),
                1 => any::<bool>().prop_map(Literal::Boolean),
            ]
            .boxed();
        }
        prop_oneof![
            any::<i64>().prop_map(Literal::Integer),
            (i64::MAX as u64 + 1..=u64::MAX).prop_map(Literal::Large),
            any::<f64>()
                .prop_filter("finite", |x| x.is_finite())
                .prop_map(Literal::Real),
            any::<String>().prop_map(Literal::Text),
            any::<bool>().prop_map(Literal::Boolean),
        ]
        .boxed()
    }

    fn path(self) -> impl Strategy<Value = AttributePath> {
        let attribute = || name(self.attributes);
        prop_oneof![
            (name(self.variables), attribute()).prop_map(|(variable, attribute)| {
                AttributePath::Node {
                    variable,
                    attribute,
                }
            }),
            (
                name(self.variables),
                name(self.labels),
                name(self.variables),
                attribute()
            )
                .prop_map(|(from, label, to, attribute)| AttributePath::Edge {
                    from,
                    label,
                    to,
                    attribute
                }),
        ]
    }

    pub(crate) fn expression(self) -> impl Strategy<Value = Expression> {
        let leaf = prop_oneof![
            self.literal().prop_map(Expression::Literal),
            self.path().prop_map(Expression::Attribute),
        ];
        leaf.prop_recursive(3, 8, 3, |inner| {
            let operator = select(&[
                Arithmetic::Add,
                Arithmetic::Subtract,
                Arithmetic::Multiply,
                Arithmetic::Divide,
            ]);
            prop_oneof![
                (operator, vec(inner.clone(), 2..4))
                    .prop_map(|(operator, operands)| Expression::Arithmetic { operator, operands }),
                inner.prop_map(|operand| Expression::Arithmetic {
                    operator: Arithmetic::Subtract,
                    operands: vec![operand],
                }),
            ]
        })
    }

    /// An expression that can be a cost.
    fn amount(self) -> impl Strategy<Value = Expression> {
        self.expression()
            .prop_filter("of 0 or more", |expression| !expression.is_no_amount())
    }

    pub(crate) fn condition(self) -> impl Strategy<Value = Condition> {
        let comparison = select(&[
            Comparison::Equal,
            Comparison::NotEqual,
            Comparison::Less,
            Comparison::LessOrEqual,
            Comparison::Greater,
            Comparison::GreaterOrEqual,
        ]);
        let leaf = prop_oneof![
            3 => (name(self.labels), name(self.variables), name(self.variables))
                .prop_map(|(label, from, to)| Condition::Edge { label, from, to }),
            1 => (name(self.variables), name(self.variables))
                .prop_map(|(a, b)| Condition::Same(a, b)),
            2 => (comparison, self.expression(), self.expression()).prop_map(|(operator, l, r)| {
                Condition::Compare { operator, left: Box::new(l), right: Box::new(r) }
            }),
        ];
        leaf.prop_recursive(4, 12, 3, move |inner| {
            let several = vec(inner.clone(), 0..3);
            let variables = vec(self.quantified(), 1..3).boxed();
            prop_oneof![
                inner
                    .clone()
                    .prop_map(|inner| Condition::Not(Box::new(inner))),
                several.clone().prop_map(Condition::And),
                several.prop_map(Condition::Or),
                (variables.clone(), inner.clone()).prop_map(|(variables, body)| {
                    Condition::Exists {
                        variables,
                        body: Box::new(body),
                    }
                }),
                (variables, inner.clone()).prop_map(|(variables, body)| Condition::Forall {
                    variables,
                    body: Box::new(body)
                }),
                (inner.clone(), inner).prop_map(|(condition, then)| Condition::When {
                    condition: Box::new(condition),
                    consequence: Box::new(then)
                }),
            ]
        })
    }

    fn effect(self) -> impl Strategy<Value = Effect> {
        let ends = || {
            (
                name(self.labels),
                name(self.variables),
                name(self.variables),
            )
        };
        let leaf = prop_oneof![
            ends().prop_map(|(label, from, to)| Effect::Link { label, from, to }),
            ends().prop_map(|(label, from, to)| Effect::Unlink { label, from, to }),
            (self.path(), self.expression())
                .prop_map(|(target, value)| Effect::Assign { target, value }),
            (name(self.variables), name(self.types)).prop_map(|(variable, type_name)| {
                Effect::Create {
                    variable,
                    type_name,
                }
            }),
            name(self.variables).prop_map(|variable| Effect::Delete { variable }),
            (name(self.variables), name(self.types)).prop_map(|(variable, type_name)| {
                Effect::Retype {
                    variable,
                    type_name,
                }
            }),
        ];
        leaf.prop_recursive(3, 8, 3, move |inner| {
            prop_oneof![
                (vec(self.quantified(), 1..3), vec(inner.clone(), 0..3))
                    .prop_map(|(variables, body)| Effect::Forall { variables, body }),
                (self.condition(), vec(inner, 0..3))
                    .prop_map(|(condition, body)| Effect::When { condition, body }),
            ]
        })
    }

    pub(crate) fn effects(self) -> impl Strategy<Value = Vec<Effect>> {
        vec(self.effect(), 0..4)
    }

    pub(crate) fn rule(self) -> impl Strategy<Value = Rule> {
        let header = (
            name(self.variables),
            prop::bool::ANY,
            prop_oneof![
                (0..9_i64)
                    .prop_map(Literal::Integer)
                    .prop_map(Expression::Literal),
                self.amount()
            ],
            option::of(self.amount()),
            option::of(name(self.variables)),
            prop_oneof![Just(1.0), 0.0..1.0],
            [prop::bool::ANY, prop::bool::ANY, prop::bool::ANY],
            vec(name(self.variables), 0..3),
            vec(comment(), 0..3),
        );
        let body = (
            self.pattern(4, 4),
            self.pattern(4, 4),
            vec(self.quantified(), 0..2),
            option::of(self.condition()),
            self.effects(),
        );
        (header, body).prop_map(
            |(header, (left, right, parameters, precondition, effect))| {
                let (name, active, cost, duration, agent, success, flags, activates, comments) =
                    header;
                let [dormant, hierarchical, strict] = flags;
                let kind = if active { Kind::Active } else { Kind::Passive };
                Rule {
                    name,
                    kind,
                    cost,
                    duration,
                    agent,
                    success,
                    dormant,
                    hierarchical,
                    strict,
                    activates,
                    left,
                    right,
                    parameters,
                    precondition,
                    effect,
                    comments,
                }
            },
        )
    }

    fn combo(self) -> impl Strategy<Value = Combo> {
        let step = (name(self.variables), name(self.variables), prop::bool::ANY).prop_map(
            |(rule, alias, optional)| ComboStep {
                rule,
                alias,
                optional,
            },
        );
        let part = (name(self.variables), name(self.attributes))
            .prop_map(|(alias, variable)| ComboVariable { alias, variable });
        let header = (name(self.variables), prop::bool::ANY, 0.0..50.0);
        let body = (
            vec(step, 1..4),
            vec(vec(part, 2..4), 0..3),
            vec(comment(), 0..2),
        );
        (header, body).prop_map(
            |((name, active, cost), (steps, equalities, comments))| Combo {
                name,
                cost,
                kind: if active { Kind::Active } else { Kind::Passive },
                steps,
                equalities,
                comments,
            },
        )
    }

    pub(crate) fn grammar(self) -> impl Strategy<Value = Grammar> {
        let types = (vec(name(self.types), 1..4), vec(name(self.types), 0..3))
            .prop_map(|(names, parents)| TypeDeclaration { names, parents });
        let property = (name(self.variables), "[^\n\r]{0,12}").prop_map(|(key, value)| Property {
            key,
            value: value.trim().to_owned(),
        });
        let include =
            ("[a-z/.# ]{1,12}[a-z]", vec(comment(), 0..2)).prop_map(|(path, comments)| Include {
                path: Name::from(path.trim()),
                comments,
            });
        (
            vec(property, 0..3),
            vec(types, 0..3),
            vec(self.rule(), 0..4),
            vec(self.combo(), 0..2),
            vec(include, 0..2),
            vec(comment(), 0..2),
        )
            .prop_map(
                |(properties, declarations, rules, combos, includes, comments)| Grammar {
                    properties,
                    types: Types { declarations },
                    rules,
                    combos,
                    unfolded: Vec::new(),
                    includes,
                    comments,
                    files: Vec::new(),
                    regions: Vec::new(),
                },
            )
    }
}

fn comment() -> impl Strategy<Value = String> {
    "[^\n\r]{0,10}".prop_map(|text| text.trim().to_owned())
}

/// Text made of pieces of grammars, whole and broken.
pub(crate) fn soup() -> impl Strategy<Value = String> {
    let pieces = [
        "{",
        "}",
        "(",
        ")",
        "=>",
        "->",
        ":",
        ",",
        ".",
        "*",
        "=",
        "===",
        "\n",
        "\n",
        "-",
        "<=",
        "#",
        "a",
        "b",
        "1",
        "-2.5",
        "1e5",
        "\"",
        "\"text\"",
        "\\",
        "e(",
        "é",
        "$",
        "active",
        "passive",
        "a : active(1)",
        "{ a:t a->a(l) }",
        "=>",
        "types {",
        "(a : b)",
        "include(",
        "x.aggl)",
        "precondition {",
        "effect {",
        "parameters {",
        "(not",
        "(and",
        "(forall v:t",
        "(when",
        "(exists",
        "(= a b)",
        "(l a b)",
        "(assign a.n 1)",
        "(create c t)",
        "where:",
        "r as s",
        "optional",
        "a.b = c.d",
        "dormant",
        "hierarchical",
        "strict",
        "success(",
        "cost (",
        "name=x\n===\n",
        "r : active(1) {\n{ a:t }\n=>\n{ a:t }\n}\n",
    ];
    vec(select(pieces.to_vec()), 0..60).prop_map(|pieces| pieces.join(" "))
}
