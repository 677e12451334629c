//! PDDL: what is read, what is refused, and that plans mean the same in both languages.

use super::*;
use crate::plan::Options;
use crate::testing::{CARE, goal, read as grammar, ring};
use expect_test::expect;

fn file(name: &str, text: &str) -> SourceFile {
    SourceFile::new(name, text)
}

fn outcome(domain: &str, problem: &str, effort: Effort) -> Outcome {
    let definition = read(&file("d.pddl", domain), &file("p.pddl", problem));
    let definition = definition.unwrap_or_else(|defects| panic!("{defects}"));
    plan(&definition, effort, &mut Limits::new())
}

fn refusal(domain: &str, problem: &str) -> String {
    let refused = read(&file("d.pddl", domain), &file("p.pddl", problem));
    refused.expect_err("something is wrong with it").to_string()
}

/// Parcels that a van brings from shop to shop; what is fragile goes by hand.
const DELIVERY: &str = "
(define (domain delivery)
  (:requirements :adl :action-costs)
  (:types van parcel - thing shop)
  (:constants depot - shop)
  (:predicates (at ?t - thing ?s - shop) (in ?p - parcel ?v - van) (road ?a ?b - shop)
               (fragile ?p - parcel) (closed ?s - shop))
  (:functions (total-cost) - number (length ?a ?b - shop) - number)
  (:action drive :parameters (?v - van ?a ?b - shop)
    :precondition (and (at ?v ?a) (or (road ?a ?b) (road ?b ?a)) (not (closed ?b)))
    :effect (and (not (at ?v ?a)) (at ?v ?b) (increase (total-cost) (length ?a ?b))
                 (forall (?p - parcel) (when (in ?p ?v) (and (not (at ?p ?a)) (at ?p ?b))))))
  (:action load :parameters (?p - parcel ?v - van ?s - shop)
    :precondition (and (at ?p ?s) (at ?v ?s)
                       (imply (fragile ?p) (forall (?q - parcel) (or (= ?p ?q) (not (in ?q ?v))))))
    :effect (and (in ?p ?v) (increase (total-cost) 1)))
  (:action unload :parameters (?p - parcel ?v - van)
    :precondition (and (in ?p ?v) (exists (?s - shop) (at ?v ?s)))
    :effect (and (not (in ?p ?v)) (increase (total-cost) (+ 0.5 0.5)))))";

const TOWN: &str = "
(define (problem town) (:domain delivery)
  (:objects v - van vase book - parcel left right - shop)
  (:init (at v depot) (at vase depot) (at book depot) (fragile vase) (road depot left)
         (road left right) (= (length depot left) 2) (= (length left depot) 2)
         (= (length left right) 3) (= (length right left) 3) (= (total-cost) 0))
  (:goal (and (at vase right) (at book left) (forall (?p - parcel) (not (in ?p v)))))
  (:metric minimize (total-cost)))";

/// Parcels from town to town: carts in the towns, one barge between their harbours.
const BARGE: &str = "
(define (domain barge)
  (:requirements :strips :typing)
  (:types vessel parcel - thing cart barge - vessel harbour - place town)
  (:predicates (at ?t - thing ?p - place) (in ?p - parcel ?v - vessel) (of ?p - place ?t - town))
  (:action drive :parameters (?c - cart ?a ?b - place ?t - town)
    :precondition (and (at ?c ?a) (of ?a ?t) (of ?b ?t)) :effect (and (not (at ?c ?a)) (at ?c ?b)))
  (:action sail :parameters (?b - barge ?x ?y - harbour)
    :precondition (at ?b ?x) :effect (and (not (at ?b ?x)) (at ?b ?y)))
  (:action load :parameters (?p - parcel ?v - vessel ?x - place)
    :precondition (and (at ?p ?x) (at ?v ?x)) :effect (and (not (at ?p ?x)) (in ?p ?v)))
  (:action unload :parameters (?p - parcel ?v - vessel ?x - place)
    :precondition (and (in ?p ?v) (at ?v ?x)) :effect (and (not (in ?p ?v)) (at ?p ?x))))";

const COAST: &str = "
(define (problem coast) (:domain barge)
  (:objects ash elm oak - town ash0 elm0 oak0 - harbour ash1 elm1 oak1 - place
            a e o - cart b - barge p q r s - parcel)
  (:init (of ash0 ash) (of ash1 ash) (of elm0 elm) (of elm1 elm) (of oak0 oak) (of oak1 oak)
         (at a ash1) (at e elm1) (at o oak0) (at b oak0) (at p ash1) (at q elm0) (at r oak1) (at s elm1))
  (:goal (and (at p elm1) (at q ash0) (at r ash1) (at s oak0))))";

#[test]
fn tasks_of_the_competitions_cost_what_other_planners_prove() {
    // By A* with the landmark-cut heuristic of Fast Downward.
    let tasks = [
        (
            include_str!("../testing/competition/elevators-domain.pddl"),
            include_str!("../testing/competition/elevators-problem.pddl"),
            33.0,
        ),
        (
            include_str!("../testing/competition/rovers-domain.pddl"),
            include_str!("../testing/competition/rovers-problem.pddl"),
            16.0,
        ),
    ];
    for (domain, problem, cost) in tasks {
        for effort in [Effort::Optimal, Effort::Anytime] {
            let planned = outcome(domain, problem, effort);
            assert_eq!((planned.cost, planned.optimal), (Some(cost), true));
        }
        let first = outcome(domain, problem, Effort::First);
        assert!(
            first.cost.is_some_and(|first| first <= 1.5 * cost),
            "{first:?}"
        );
    }
}

#[test]
fn the_best_plan_is_proved_with_few_states() {
    let planned = outcome(BARGE, COAST, Effort::Optimal);
    assert!(planned.optimal);
    assert_eq!(planned.cost, Some(28.0));
    // 2266; who takes any of the dearest needs instead of the rarest expands 3808.
    assert!(planned.expanded < 3000, "{}", planned.expanded);
}

#[test]
fn quantifiers_conditions_and_costs_mean_what_pddl_says() {
    let planned = outcome(DELIVERY, TOWN, Effort::Optimal);
    expect![[r"
        (load vase v depot)
        (load book v depot)
        (drive v depot left)
        (unload book v)
        (drive v left right)
        (unload vase v)
        ; cost = 9 (general cost)
    "]]
    .assert_eq(&plan_file(&planned, None));
    assert_eq!(
        (planned.optimal, planned.steps[0].binding["p"].as_str()),
        (true, "vase")
    );
    // Where nothing is said of costs, steps are counted.
    let steps = TOWN.replace("(:metric minimize (total-cost))", "");
    let planned = outcome(DELIVERY, &steps, Effort::First);
    assert_eq!((planned.cost, planned.steps.len()), (Some(6.0), 6));
}

#[test]
fn what_no_action_brings_about_is_the_reason() {
    let closed = TOWN.replace("(fragile vase)", "(closed right)");
    let planned = outcome(DELIVERY, &closed, Effort::Optimal);
    assert_eq!(planned.status, Status::Unsolvable);
    expect!["(at vase right) cannot be reached"].assert_eq(&planned.reason.unwrap());
    let unknown = TOWN.replace("(= (length left right) 3)", "");
    let planned = outcome(DELIVERY, &unknown, Effort::Optimal);
    expect!["(at vase right) cannot be reached; (drive v left right) was left out, since (length left right) has no value"].assert_eq(&planned.reason.unwrap());
    let held = "(define (domain d) (:predicates (p) (q)) (:action a :parameters () :effect (q)))";
    let problem = "(define (problem x) (:domain d) (:init (p)) (:goal (and (q) (not (p)))))";
    let planned = outcome(held, problem, Effort::First);
    expect!["no action brings about what the goal asks for"].assert_eq(&planned.reason.unwrap());
}

#[test]
fn everything_that_is_wrong_is_told_at_its_place() {
    let domain = "(define (domain d)
  (:requirements :strips :typng :durative-actions)
  (:types a b - c c - b)
  (:predicates (p ?x - a) (p) (q ?x - d))
  (:action go :parameters (?x - a ?x) :precondition (and (pp ?x) (p ?y) (p)) :effect (p z))
  (:action go :parameters (?x - b) :precondition (p ?x) :effect (assign (f) 1)))";
    let problem = "(define (problem x) (:domain e)
  (:objects o - a o) (:int (p o))
  (:goal (and (p o) (< (f) 1)))
  (:metric maximize (total-cost)))";
    expect![[r"
        d.pddl:2:26: no requirement `:typng` is declared (did you mean `:typing`?)
        d.pddl:2:33: the requirement `:durative-actions` is not supported
        d.pddl:3:23: type `b` inherits from itself
        d.pddl:3:17: type `c` inherits from itself
        d.pddl:4:28: predicate `p` is declared twice
        d.pddl:4:39: no type `d` is declared
        p.pddl:2:19: object `o` is declared twice
        d.pddl:5:35: variable `?x` is declared twice
        d.pddl:5:59: no predicate `pp` is declared (did you mean `p`?)
        d.pddl:5:69: no variable `?y` is declared (did you mean `?x`?)
        d.pddl:5:74: `p` takes 1 arguments, not 0
        d.pddl:5:89: no object `z` is declared
        d.pddl:6:12: action `go` is declared twice
        d.pddl:6:66: `assign` is not supported
        p.pddl:2:23: no section `:int` is declared (did you mean `:init`?)
        p.pddl:1:30: this problem is for the domain `e`, the domain is `d`
        p.pddl:3:21: a condition on numbers is not supported
        p.pddl:4:4: a metric other than `minimize (total-cost)` is not supported"]]
    .assert_eq(&refusal(domain, problem));
    // Of a problem that is not closed nothing is known, of its domain all.
    let told = refusal(domain, "(define (problem p) (:domain d");
    assert!(
        told.starts_with("p.pddl") && told.contains("d.pddl"),
        "{told}"
    );
}

#[test]
fn brackets_are_held_against_each_other() {
    let good = "(define (problem x) (:domain d) (:init) (:goal (and)))";
    let cases = [
        "(define (domain d) (:predicates (p))",
        "(define (domain d)\n  (:predicates (p)))\n)",
        "(define (domain d)) (more)",
        "domain",
        "; nothing\n",
    ];
    let refusals: Vec<String> = cases.iter().map(|text| refusal(text, good)).collect();
    expect![[r"
        d.pddl:1:1: `(` is never closed
        d.pddl:3:1: `)` closes nothing
        d.pddl:1:21: the definition ends before this
        d.pddl:1:1: expected `(define ...)`, found `domain`
        d.pddl:1:1: there is no `(define ...)` in this file"]]
    .assert_eq(&refusals.join("\n"));
    let deep = format!("(define (domain d) {}", "(".repeat(5000));
    assert!(refusal(&deep, good).contains("nested more than 256 deep"));
}

/// A blank that is none in ASCII was read as a word of no length, again and again, until the memory was
/// full.
#[test]
fn every_blank_is_one() {
    for blank in ["\u{b}", "\u{85}", "\u{2003}"] {
        let told = refusal(&format!("(define{blank}(domain d)"), "");
        assert!(told.contains("`(` is never closed"), "{told}");
    }
}

#[test]
fn rules_in_pddl_have_the_same_best_plan() {
    let rules = grammar(CARE);
    let graph = ring(&rules);
    let options = Options {
        effort: Effort::Optimal,
        ..Options::default()
    };
    for wanted in [
        "{ \"shelly\":robot \"kitchen\":room \"shelly\"->\"kitchen\"(in) }",
        "{ \"ana\":person \"shelly\":robot \"shelly\"->\"ana\"(is_near) }",
        "{ r:robot p:place a:room r->a(in) p->a(in) }",
    ] {
        let wanted = goal(&rules, wanted);
        let snapshot = graph.snapshot();
        let limits = &mut Limits::new();
        let planned = crate::plan(&rules, &snapshot, &wanted, &options, limits).unwrap();
        let text = write(&rules, &snapshot, &wanted, &options, &mut Limits::new()).unwrap();
        let again = outcome(&text.domain, &text.problem, Effort::Optimal);
        assert_eq!(
            planned.cost,
            again.cost.map(|cost| cost / text.scale),
            "{}",
            text.domain
        );
        // The plan over the rules is one over the written actions.
        let names: Vec<String> = plan_file(&planned, Some(&text))
            .lines()
            .filter(|line| line.starts_with('('))
            .map(|line| format!("(:action {} :", line.trim_matches(['(', ')'])))
            .collect();
        let tidy = text.domain.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            names.iter().all(|name| tidy.contains(name.as_str())),
            "{names:?}\n{tidy}"
        );
    }
}

#[test]
fn a_goal_that_cannot_hold_and_one_that_holds_already_are_written_so() {
    let rules = grammar(CARE);
    let graph = ring(&rules);
    let snapshot = graph.snapshot();
    let cases = [
        (
            "{ \"shelly\":robot \"hall\":room \"shelly\"->\"hall\"(in) }",
            Some(0.0),
        ),
        (
            "{ \"shelly\":robot \"ana\":person \"shelly\"->\"ana\"(front) }",
            None,
        ),
        (
            "{ \"hall\":room \"shelly\":robot \"ward\":room \"shelly\"->\"ward\"(in) \"hall\"->\"shelly\"(in) }",
            None,
        ),
    ];
    for (wanted, cost) in cases {
        let wanted = goal(&rules, wanted);
        let options = Options::default();
        let text = write(&rules, &snapshot, &wanted, &options, &mut Limits::new()).unwrap();
        let planned = outcome(&text.domain, &text.problem, Effort::Optimal);
        assert_eq!(planned.cost, cost, "{}{}", text.domain, text.problem);
    }
}
