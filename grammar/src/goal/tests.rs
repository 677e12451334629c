//! Goals against the naive oracle, and on the care centre.

use super::*;
use crate::testing::oracle::Model;
use crate::testing::random::FEW;
use crate::testing::repair::repaired;
use crate::testing::{CARE, apply, care_centre, read};
use crate::{Types, parse_goal, parse_grammar};
use proptest::prelude::*;

fn tell(grammar: &Grammar, graph: &dsr::Graph, text: &str) -> String {
    let goal = parse_goal(text, "goal", &Types::default()).unwrap();
    let snapshot = graph.snapshot();
    let held = grammar.goal_holds(&snapshot, &goal).unwrap();
    let obstacle = grammar.goal_obstacle(&snapshot, &goal).unwrap();
    assert_eq!(held.is_some(), obstacle.is_none());
    obstacle.map_or_else(
        || held.unwrap().to_string(),
        |obstacle| obstacle.to_string(),
    )
}

#[test]
fn a_goal_holds_once_the_robot_is_there_and_says_what_is_missing_before() {
    let grammar = read(CARE);
    let mut centre = care_centre();
    let goal = "{ \"shelly\":robot \"kitchen\":room \"shelly\"->\"kitchen\"(in) }";
    assert_eq!(
        tell(&grammar, &centre, goal),
        "\"shelly\" has no link `in` to \"kitchen\""
    );
    let binding = [("robot", "shelly"), ("room1", "hall"), ("room2", "kitchen")];
    apply(&mut centre, &grammar, "changeRoom", &binding).unwrap();
    assert_eq!(
        tell(&grammar, &centre, goal),
        "\"shelly\" = 4, \"kitchen\" = 2"
    );

    let by_id = "{ 4:robot r:room p:person 4->r(in) p->r(in) }";
    assert_eq!(tell(&grammar, &centre, by_id), "4 = 4, r = 2, p = 5");
    let wrong = "{ \"shely\":robot r:room \"shely\"->r(in) }";
    assert_eq!(tell(&grammar, &centre, wrong), "there is no node \"shely\"");
    let everybody = "{ 4:robot } precondition { (forall p:person (is_near 4 p)) }";
    assert_eq!(
        tell(&grammar, &centre, everybody),
        "for p (ana): 4 (shelly) has no link `is_near` to p (ana)"
    );
    let nowhere = "{ 4:robot p:person 4->p(is_near) }";
    assert_eq!(
        tell(&grammar, &centre, nowhere),
        "nothing in the graph matches the goal"
    );
}

proptest! {
    #![proptest_config(crate::testing::cases(1000))]

    #[test]
    fn a_goal_holds_where_the_oracle_says_so(
        model in Model::strategy(),
        rule in FEW.rule(),
        which in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let (mut grammar, _) = parse_grammar(crate::testing::oracle::TYPES, "types.aggl");
        let mut rule = rule;
        rule.parameters.clear();
        grammar.rules.push(repaired(rule));
        let rule = &grammar.rules[0];
        let mut goal = Goal {
            pattern: rule.left.clone(),
            precondition: rule.precondition.clone(),
            ..Goal::default()
        };
        let constant = which.filter(|_| !model.nodes.is_empty() && !goal.pattern.nodes.is_empty());
        if let Some(which) = constant {
            let name = model.nodes.keys().nth(which.index(model.nodes.len())).unwrap();
            let variable = goal.pattern.nodes[which.index(goal.pattern.nodes.len())].variable.to_string();
            goal.constants.insert(variable, Constant::Name(name.clone()));
        }
        let fixed = |at: &crate::testing::oracle::Assignment| {
            goal.constants.iter().all(|(variable, constant)| {
                matches!(constant, Constant::Name(name) if at[variable] == *name)
            })
        };
        let all = model.assignments(rule);
        let expected = all.iter().any(|at| fixed(at) && model.rule_holds(rule, at));
        let graph = model.to_graph();
        let snapshot = graph.snapshot();
        let found = grammar.goal_holds(&snapshot, &goal).unwrap();
        prop_assert_eq!(found.is_some(), expected, "{}", goal);
        let obstacle = grammar.goal_obstacle(&snapshot, &goal).unwrap();
        prop_assert_eq!(obstacle.is_none(), expected, "{} {:?}", goal, obstacle);
    }
}
