//! A grammar or goal against the schema of the graph that it is meant for.
//!
//! Guarantee: a rule without complaints uses only types, labels and attributes that the schema
//! has, and its links join types that the schema lets them join.

use crate::apply::convert;
use crate::matching::MatchDomain;
use crate::parser::Finding;
use crate::{
    AttributePath, Condition, Diagnostic, Effect, Expression, Goal, Grammar, Name, Pattern,
    PatternNode, Problem, Rule, SourceFile,
};
use dsr::{Schema, SchemaError, Value, suggest};

impl Grammar {
    /// What of the grammar does not fit the schema; nothing if the schema is open.
    ///
    /// A type of the types block that the schema does not have may be matched if types that
    /// inherit from it are in the schema, but no node can be made of it.
    pub fn check_schema(&self, schema: &Schema) -> Vec<Diagnostic> {
        if schema.is_open() {
            return Vec::new();
        }
        let mut check = SchemaCheck {
            grammar: self,
            schema,
            findings: Vec::new(),
        };
        for rule in &self.rules {
            check.rule(rule);
        }
        check.into_diagnostics(&self.files)
    }

    /// What of a goal, read from `file`, does not fit the schema; nothing if the schema is open.
    pub fn check_goal_schema(
        &self,
        goal: &Goal,
        file: &SourceFile,
        schema: &Schema,
    ) -> Vec<Diagnostic> {
        if schema.is_open() {
            return Vec::new();
        }
        let mut check = SchemaCheck {
            grammar: self,
            schema,
            findings: Vec::new(),
        };
        let mut scope: Vec<PatternNode> = goal.pattern.nodes.clone();
        check.pattern(&goal.pattern, &scope);
        if let Some(condition) = &goal.precondition {
            check.condition(condition, &mut scope);
        }
        check.into_diagnostics(std::slice::from_ref(file))
    }
}

struct SchemaCheck<'a> {
    grammar: &'a Grammar,
    schema: &'a Schema,
    findings: Vec<Finding>,
}

impl SchemaCheck<'_> {
    fn into_diagnostics(mut self, files: &[SourceFile]) -> Vec<Diagnostic> {
        self.findings.sort_by_key(|finding| finding.span);
        self.findings
            .dedup_by(|a, b| a.span == b.span && a.problem == b.problem);
        crate::load::diagnostics(self.findings, files)
    }

    fn report(&mut self, at: &Name, problem: Problem) {
        self.findings.push(Finding {
            span: at.span(),
            problem,
            related: None,
        });
    }

    fn unknown<'n>(
        &mut self,
        what: &'static str,
        name: &Name,
        known: impl IntoIterator<Item = &'n str>,
    ) {
        let suggestion = suggest(name, known);
        self.report(
            name,
            Problem::NotInSchema {
                what,
                name: name.to_string(),
                suggestion,
            },
        );
    }

    fn rule(&mut self, rule: &Rule) {
        let bound: Vec<PatternNode> = rule.bound_nodes().cloned().collect();
        self.pattern(&rule.left, &bound);
        for parameter in &rule.parameters {
            self.matched_type(&parameter.type_name);
        }
        let mut after = rule.right.nodes.clone();
        let not_on_right = |node: &&PatternNode| rule.right.node(&node.variable).is_none();
        after.extend(bound.iter().filter(not_on_right).cloned());
        for node in &rule.right.nodes {
            let before = bound.iter().find(|before| before.variable == node.variable);
            if before.is_none_or(|before| before.type_name != node.type_name) {
                self.made_type(&node.type_name);
            }
        }
        self.edges(&rule.right, &after);
        for expression in [Some(&rule.cost), rule.duration.as_ref()]
            .into_iter()
            .flatten()
        {
            self.expression(expression, &bound);
            self.amount(expression);
        }
        if let Some(condition) = &rule.precondition {
            self.condition(condition, &mut bound.clone());
        }
        self.effects(&rule.effect, &mut bound.clone(), &mut after);
    }

    fn pattern(&mut self, pattern: &Pattern, scope: &[PatternNode]) {
        for node in &pattern.nodes {
            self.matched_type(&node.type_name);
        }
        self.edges(pattern, scope);
    }

    fn edges(&mut self, pattern: &Pattern, scope: &[PatternNode]) {
        for edge in &pattern.edges {
            self.link(&edge.label, &edge.from, &edge.to, scope);
        }
    }

    /// A type of nodes that are looked for.
    fn matched_type(&mut self, name: &Name) {
        let domain = MatchDomain::new(&self.grammar.types, self.schema, name);
        if domain.types().is_empty() {
            let schema = self.schema;
            self.unknown(
                "type",
                name,
                schema.types().iter().map(|known| known.name.as_str()),
            );
        }
    }

    /// A type of nodes that are made.
    fn made_type(&mut self, name: &Name) {
        if self.schema.find_type(name).is_none() {
            let schema = self.schema;
            self.unknown(
                "type",
                name,
                schema.types().iter().map(|known| known.name.as_str()),
            );
        }
    }

    /// The label is known and can join nodes of these types.
    fn link(&mut self, label: &Name, from: &Name, to: &Name, scope: &[PatternNode]) {
        let schema = self.schema;
        let Some(id) = schema.find_label(label) else {
            self.unknown(
                "label",
                label,
                schema.labels().iter().map(|known| known.name.as_str()),
            );
            return;
        };
        let type_of = |variable: &Name| {
            let node = scope.iter().rev().find(|node| node.variable == *variable)?;
            Some(&node.type_name)
        };
        let (Some(from_type), Some(to_type)) = (type_of(from), type_of(to)) else {
            return;
        };
        let types = &self.grammar.types;
        let sources = MatchDomain::new(types, schema, from_type);
        let targets = MatchDomain::new(types, schema, to_type);
        // Unknown types are told of elsewhere.
        let possible = sources.types().is_empty()
            || targets.types().is_empty()
            || sources.types().iter().any(|&source| {
                let fits = |&target: &_| schema.check_ends(id, source, target).is_ok();
                targets.types().iter().any(fits)
            });
        if !possible {
            let (from, to) = (from_type.to_string(), to_type.to_string());
            self.report(
                label,
                Problem::WrongEnds {
                    label: label.to_string(),
                    from,
                    to,
                },
            );
        }
    }

    fn attribute(&mut self, name: &Name) {
        let schema = self.schema;
        if schema.find_attribute(name).is_none() {
            let known = schema.attributes().iter().map(|known| known.name.as_str());
            self.unknown("attribute", name, known);
        }
    }

    /// A cost or duration reckons with numbers only.
    fn amount(&mut self, expression: &Expression) {
        let path = match expression {
            Expression::Literal(_) => return,
            Expression::Attribute(path) => path,
            Expression::Arithmetic { operands, .. } => {
                return operands.iter().for_each(|operand| self.amount(operand));
            }
        };
        let (AttributePath::Node { attribute, .. } | AttributePath::Edge { attribute, .. }) = path;
        let found = self.schema.find_attribute(attribute);
        let kind = found.and_then(|id| self.schema.attributes()[usize::from(id.0)].kind);
        if let Some(kind) = kind.filter(|kind| convert(&Value::I64(0), *kind).is_none()) {
            let (path, kind) = (path.to_string(), kind.to_string());
            self.report(attribute, Problem::NoNumber { path, kind });
        }
    }

    fn path(&mut self, path: &AttributePath, scope: &[PatternNode]) {
        match path {
            AttributePath::Node { attribute, .. } => self.attribute(attribute),
            AttributePath::Edge {
                from,
                label,
                to,
                attribute,
            } => {
                self.attribute(attribute);
                self.link(label, from, to, scope);
            }
        }
    }

    fn expression(&mut self, expression: &Expression, scope: &[PatternNode]) {
        match expression {
            Expression::Literal(_) => {}
            Expression::Attribute(path) => self.path(path, scope),
            Expression::Arithmetic { operands, .. } => {
                for operand in operands {
                    self.expression(operand, scope);
                }
            }
        }
    }

    /// A value that the store would refuse.
    fn assigned(&mut self, target: &AttributePath, value: &Expression) {
        let (AttributePath::Node { attribute, .. } | AttributePath::Edge { attribute, .. }) =
            target;
        let Some(id) = self.schema.find_attribute(attribute) else {
            return;
        };
        let kind = self.schema.attributes()[usize::from(id.0)].kind;
        let fitted = |value: &Value| {
            let converted = kind.and_then(|kind| convert(value, kind));
            converted.unwrap_or_else(|| value.clone())
        };
        let refused = match value {
            Expression::Literal(literal) => {
                self.schema.check_value(id, &fitted(&literal.value())).err()
            }
            // Whatever the number, it is one.
            Expression::Arithmetic { .. } => {
                let refused = self.schema.check_value(id, &fitted(&Value::I64(0))).err();
                refused.filter(|error| matches!(error, SchemaError::WrongKind { .. }))
            }
            Expression::Attribute(_) => None,
        };
        if let Some(error) = refused {
            let reason = error.to_string();
            self.report(attribute, Problem::NeverAssigned { reason });
        }
    }

    fn condition(&mut self, condition: &Condition, scope: &mut Vec<PatternNode>) {
        match condition {
            Condition::Edge { label, from, to } => self.link(label, from, to, scope),
            Condition::Same(..) => {}
            Condition::Compare { left, right, .. } => {
                self.expression(left, scope);
                self.expression(right, scope);
            }
            Condition::Not(inner) => self.condition(inner, scope),
            Condition::And(all) | Condition::Or(all) => {
                for inner in all {
                    self.condition(inner, scope);
                }
            }
            Condition::Exists { variables, body } | Condition::Forall { variables, body } => {
                let outer = self.quantify(variables, scope);
                self.condition(body, scope);
                scope.truncate(outer);
            }
            Condition::When {
                condition,
                consequence,
            } => {
                self.condition(condition, scope);
                self.condition(consequence, scope);
            }
        }
    }

    fn quantify(&mut self, variables: &[PatternNode], scope: &mut Vec<PatternNode>) -> usize {
        for variable in variables {
            self.matched_type(&variable.type_name);
        }
        let outer = scope.len();
        scope.extend_from_slice(variables);
        outer
    }

    fn effects(
        &mut self,
        effects: &[Effect],
        before: &mut Vec<PatternNode>,
        after: &mut Vec<PatternNode>,
    ) {
        let outer = after.len();
        for effect in effects {
            match effect {
                Effect::Link { label, from, to } | Effect::Unlink { label, from, to } => {
                    self.link(label, from, to, after);
                }
                Effect::Assign { target, value } => {
                    self.path(target, after);
                    self.expression(value, before);
                    self.assigned(target, value);
                }
                Effect::Create {
                    variable,
                    type_name,
                } => {
                    self.made_type(type_name);
                    after.push(PatternNode::new(variable.clone(), type_name.clone()));
                }
                Effect::Delete { .. } => {}
                Effect::Retype { type_name, .. } => self.made_type(type_name),
                Effect::Forall { variables, body } => {
                    let sizes = (self.quantify(variables, before), after.len());
                    after.extend_from_slice(variables);
                    self.effects(body, before, after);
                    before.truncate(sizes.0);
                    after.truncate(sizes.1);
                }
                Effect::When { condition, body } => {
                    self.condition(condition, before);
                    self.effects(body, before, after);
                }
            }
        }
        after.truncate(outer);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::needless_raw_string_hashes, reason = "expect-test writes them")]

    use crate::testing::{CARE, read};
    use crate::{Defects, SourceFile, parse_goal};
    use dsr::Schema;
    use expect_test::expect;

    fn schema() -> Schema {
        Schema::from_toml(
            "schema.toml",
            r#"
            [types]
            thing = []
            room = ["thing"]
            place = ["thing"]
            person = ["thing"]
            robot = ["thing"]
            [labels]
            in = { from = ["person", "robot", "place"], to = ["room"] }
            connected = { from = ["room"], to = ["room"] }
            at = { from = ["robot"], to = ["place"] }
            is_near = { from = ["robot"], to = ["person"] }
            interacting = { from = ["person"], to = [] }
            front = { from = ["person"], to = ["robot"] }
            [attributes]
            distance = { kind = "f64" }
            level = { kind = "u32", max = 9.0 }
            name = { kind = "string" }
            "#,
        )
        .unwrap()
    }

    #[test]
    fn the_scenario_rules_fit_their_schema() {
        let diagnostics = read(CARE).check_schema(&schema());
        assert!(diagnostics.is_empty(), "{}", Defects { diagnostics });
        assert!(read(CARE).check_schema(&Schema::open()).is_empty());
    }

    #[test]
    fn values_that_the_store_would_refuse_are_told() {
        let text = "name=x
===
r : active(1)
{
	{ a:room }
	=>
	{ a:room }
	effect
	{
		(assign a.level 10)
		(assign a.level -1)
		(assign a.level 2.5)
		(assign a.level \"low\")
		(assign a.name 3)
		(forall p:person (assign p.name (+ a.level 1)))
		(assign a.level 9.0)
		(assign a.level (+ a.level 1))
		(assign a.name \"hall\")
	}
}
";
        let diagnostics = read(text).check_schema(&schema());
        expect![[r#"
            test.aggl:10:13: error: this can never be assigned: `level` must lie in [-inf, 9], not 10
            test.aggl:11:13: error: this can never be assigned: `level` is a u32, not a i64
            test.aggl:12:13: error: this can never be assigned: `level` is a u32, not a f64
            test.aggl:13:13: error: this can never be assigned: `level` is a u32, not a string
            test.aggl:14:13: error: this can never be assigned: `name` is a string, not a i64
            test.aggl:15:30: error: this can never be assigned: `name` is a string, not a i64"#]].assert_eq(&Defects { diagnostics }.to_string());
    }

    #[test]
    fn costs_that_are_no_numbers_are_told() {
        let text = "name=x\n===\n\
                    r : active(1) cost (a.name) duration (* 2 a.name) { { a:room } => { a:room } }\n\
                    s : active(1) cost (e(a, at, b).distance) { { a:room b:room } => { a:room } }\n\
                    t : active(1) cost (a.level) duration (e(a, connected, b).distance) { { a:room b:room } => { a:room } }\n";
        let diagnostics = read(text).check_schema(&schema());
        expect![[r#"
            test.aggl:3:23: error: a cost or duration is a number, and `a.name` is a string by the schema
            test.aggl:3:45: error: a cost or duration is a number, and `a.name` is a string by the schema
            test.aggl:4:26: error: `at` never joins a `room` to a `room` by the schema"#]].assert_eq(&Defects { diagnostics }.to_string());
    }

    #[test]
    fn unknown_names_and_impossible_links_are_told_with_their_places() {
        let text = "name=x
===
r : active(1) cost (e(a, conected, b).distanse)
{
	{ a:room b:room p:persn a->b(connected) a->b(in) a->b(door)* }
	=>
	{ a:room b:hall }
	precondition { (forall q:person (front q a)) }
	effect { (create n visitor) (in n a) (assign a.seen 1) }
}
";
        let diagnostics = read(text).check_schema(&schema());
        expect![[r#"
            test.aggl:3:26: error: the schema has no label `conected` (did you mean `connected`?)
            test.aggl:3:39: error: the schema has no attribute `distanse` (did you mean `distance`?)
            test.aggl:5:20: error: the schema has no type `persn` (did you mean `person`?)
            test.aggl:5:47: error: `in` never joins a `room` to a `room` by the schema
            test.aggl:5:56: error: the schema has no label `door`
            test.aggl:7:13: error: the schema has no type `hall`
            test.aggl:8:35: error: `front` never joins a `person` to a `room` by the schema
            test.aggl:9:21: error: the schema has no type `visitor`
            test.aggl:9:49: error: the schema has no attribute `seen`"#]]
        .assert_eq(&Defects { diagnostics }.to_string());

        let grammar = read(CARE);
        let text = "{ \"shelly\":robot r:room r->\"shelly\"(in) }";
        let goal = parse_goal(text, "goal", &grammar.types).unwrap();
        let file = SourceFile::new("goal", text);
        let diagnostics = grammar.check_goal_schema(&goal, &file, &schema());
        expect!["goal:1:37: error: `in` never joins a `room` to a `robot` by the schema"]
            .assert_eq(&Defects { diagnostics }.to_string());
    }
}
