//! What a manifest gives is allowed, and nothing else is.

use super::*;
use crate::{
    EdgeRef, Graph, NodeId, NodeRef, Operation, Owner, RuleEngine, Snapshot, Time, Transaction,
    Value,
};

const SCHEMA: &str = r#"
[types]
thing = []
robot = ["thing"]
person = ["thing"]
child = ["person"]
[labels]
in = {}
sees = {}
[attributes]
radius = { kind = "f64" }
mood = { kind = "f64" }
"#;

const DRIVER: &str = r#"
agent = "driver"
nodes = ["person"]
edges = ["sees"]
attributes = ["robot.radius", "sees.mood"]
rules = ["agent(driver)"]
"#;

/// Rules that make a person happy; the grammar gives the one to the driver.
#[derive(Debug)]
struct Rules;

impl RuleEngine for Rules {
    fn expand(
        &self,
        _: &Snapshot,
        _: &str,
        _: &[(String, NodeId)],
    ) -> Result<Vec<Operation>, Refusal> {
        Ok(vec![Operation::SetAttribute {
            owner: Owner::Node("ann".into()),
            name: "mood".into(),
            value: 1.0.into(),
        }])
    }

    fn actor(&self, rule: &str) -> Option<&str> {
        (rule == "cheer").then_some("driver")
    }
}

fn graph() -> Graph {
    let schema = Schema::from_toml("schema.toml", SCHEMA).unwrap();
    let driver = Manifest::from_toml("driver.toml", DRIVER, &schema).unwrap();
    let mut graph = Graph::in_memory(schema);
    let mut transaction = Transaction::new();
    transaction.create_node("robot", "robot", vec![]);
    transaction.create_node("person", "ann", vec![]);
    graph
        .commit(&transaction, "setup", Time::default())
        .unwrap();
    graph.set_rights([driver, Manifest::everything("tool")]);
    graph.set_rules(Arc::new(Rules));
    graph
}

fn refusal(graph: &mut Graph, agent: &str, operation: Operation) -> Option<Refusal> {
    let mut transaction = Transaction::new();
    transaction.push(operation);
    graph.commit(&transaction, agent, Time::default()).err()
}

fn create(type_name: &str, attributes: Vec<(String, Value)>) -> Operation {
    Operation::CreateNode {
        id: None,
        type_name: type_name.into(),
        name: format!("a-{type_name}"),
        attributes,
    }
}

fn set(owner: Owner, name: &str) -> Operation {
    Operation::SetAttribute {
        owner,
        name: name.into(),
        value: 0.5.into(),
    }
}

fn link(label: &str) -> Operation {
    Operation::CreateEdge {
        edge: EdgeRef::new("robot", label, "ann"),
        attributes: vec![],
    }
}

#[test]
fn what_the_manifest_gives_is_allowed_and_nothing_else() {
    let seen = || Owner::Edge(EdgeRef::new("robot", "sees", "ann"));
    let apply = |rule: &str| Operation::ApplyRule {
        rule: rule.into(),
        binding: vec![],
    };
    let allowed = [
        create("person", vec![]),
        create("child", vec![]),
        Operation::DeleteNode {
            node: NodeRef::from("a-child"),
        },
        link("sees"),
        set(Owner::Node("robot".into()), "radius"),
        set(seen(), "mood"),
        // Its operations are the rule's, not the agent's.
        apply("cheer"),
    ];
    let forbidden = [
        create("robot", vec![]),
        Operation::DeleteNode {
            node: NodeRef::from("robot"),
        },
        Operation::RetypeNode {
            node: NodeRef::from("ann"),
            type_name: "robot".into(),
        },
        Operation::RetypeNode {
            node: NodeRef::from("robot"),
            type_name: "person".into(),
        },
        create("child", vec![("mood".into(), 1.0.into())]),
        link("in"),
        set(Owner::Node("robot".into()), "mood"),
        set(Owner::Node("ann".into()), "radius"),
        set(seen(), "radius"),
        Operation::RemoveAttribute {
            owner: Owner::Node("ann".into()),
            name: "mood".into(),
        },
        apply("other"),
    ];
    let mut graph = graph();
    for operation in allowed {
        let refused = refusal(&mut graph, "driver", operation.clone());
        assert_eq!(refused, None, "{operation:?}");
    }
    for operation in &forbidden {
        let refused = refusal(&mut graph, "driver", operation.clone());
        let not_allowed = matches!(refused, Some(Refusal::NotAllowed(_)));
        assert!(not_allowed, "{operation:?}: {refused:?}");
        let refused = refusal(&mut graph, "nobody", operation.clone());
        let Some(Refusal::NotAllowed(why)) = refused else {
            panic!("{operation:?}: {refused:?}")
        };
        assert!(why.contains("no manifest"), "{why}");
    }
    for operation in forbidden {
        let refused = refusal(&mut graph, "tool", operation.clone());
        let not_allowed = matches!(refused, Some(Refusal::NotAllowed(_)));
        assert!(!not_allowed, "{operation:?}: {refused:?}");
    }
}

#[test]
fn the_refusal_names_the_right_that_is_missing() {
    let mut graph = graph();
    let refused = refusal(
        &mut graph,
        "driver",
        set(Owner::Node("ann".into()), "radius"),
    );
    assert_eq!(
        refused.unwrap().to_string(),
        "not allowed: the manifest of `driver` gives no right to write the attribute \
         `person.radius`"
    );
}
