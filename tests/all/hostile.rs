//! Every decoder against bytes that nobody would write: random ones, and good ones that were spoilt.
//! The functions are those of the fuzz targets.

#[allow(unreachable_pub, reason = "they are public to the fuzz targets")]
#[path = "../../fuzz/src/entries.rs"]
mod entries;

use crate::support::root;
use dsr::wire::{encode_change, encode_desk, encode_transaction};
use dsr::{Epoch, Graph, Image, Schema, Time, Transaction};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

/// How a good text is spoilt, one after the other.
#[derive(Debug, Clone)]
enum Harm {
    Overwrite(usize, u8),
    Remove(usize, usize),
    Repeat(usize, usize),
    Insert(usize, Vec<u8>),
}

fn harm() -> impl Strategy<Value = Harm> {
    let places = any::<prop::sample::Index>().prop_map(|i| i.index(1 << 20));
    let word = prop::sample::select(vec![
        "{",
        "}",
        "[",
        "]",
        "\"",
        "=",
        "(",
        ")",
        "<",
        ">",
        "->",
        "*",
        ":",
        ",",
        "0",
        "-1",
        "1e999",
        "null",
        "id",
        "\u{0}",
        "\u{feff}",
        "é",
        "18446744073709551615",
        "-9223372036854775808",
    ]);
    prop_oneof![
        (places.clone(), any::<u8>()).prop_map(|(at, byte)| Harm::Overwrite(at, byte)),
        (places.clone(), 1..40usize).prop_map(|(at, length)| Harm::Remove(at, length)),
        (places.clone(), 1..40usize).prop_map(|(at, length)| Harm::Repeat(at, length)),
        (places, word).prop_map(|(at, word)| Harm::Insert(at, word.into())),
    ]
}

fn spoil(good: &[u8], harms: &[Harm]) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for harm in harms {
        let (Harm::Overwrite(at, _)
        | Harm::Remove(at, _)
        | Harm::Repeat(at, _)
        | Harm::Insert(at, _)) = harm;
        let at = at % bytes.len().max(1);
        let until = |length: &usize| (at + length).min(bytes.len());
        match harm {
            Harm::Overwrite(_, byte) => {
                if let Some(place) = bytes.get_mut(at) {
                    *place = *byte;
                }
            }
            Harm::Remove(_, length) => drop(bytes.drain(at..until(length))),
            Harm::Repeat(_, length) => {
                let again = bytes[at..until(length)].to_vec();
                bytes.splice(at..at, again);
            }
            Harm::Insert(_, word) => {
                bytes.splice(at..at.min(bytes.len()), word.iter().copied());
            }
        }
    }
    bytes
}

/// `CORTEX_ROUNDS` asks for more than the default.
fn rounds(default: u32) -> Config {
    let asked = std::env::var("CORTEX_ROUNDS").map(|text| text.parse().unwrap());
    Config {
        cases: asked.unwrap_or(default),
        failure_persistence: None,
        ..Config::default()
    }
}

fn withstands(entry: fn(&[u8]), good: &[u8]) {
    entry(good);
    let bytes = prop_oneof![
        1 => prop::collection::vec(any::<u8>(), 0..200),
        4 => prop::collection::vec(harm(), 1..6).prop_map({
            let good = good.to_vec();
            move |harms| spoil(&good, &harms)
        }),
    ];
    TestRunner::new(rounds(200))
        .run(&bytes, |bytes| {
            entry(&bytes);
            Ok(())
        })
        .unwrap();
}

fn shipped(path: &str) -> Vec<u8> {
    std::fs::read(root().join(path)).unwrap()
}

const GRAPH: &str = r#"{"format":"dsr/1","nodes":[
    {"id":1,"type":"Room","name":"kitchen","attributes":{"area":12.5}},
    {"id":2,"type":"Robot","name":"shelly","attributes":{"n":{"type":"u64","value":"7"}}}],
    "edges":[{"from":2,"label":"in","to":1,"attributes":{"since":3}}]}"#;

const ROBOCOMP: &str = r#"{"DSRModel":{"name":"x","symbols":{"1":{"id":"1","name":"world",
    "type":"world","attribute":{"level":{"type":1,"value":0},"pose":{"type":3,"value":[1.0,2.0]}},
    "links":[{"src":"1","dst":"2","label":"RT","linkAttribute":{"t":{"type":2,"value":1.5}}}]},
    "2":{"id":"2","name":"robot","type":"robot","attribute":{},"links":[]}}}}"#;

const AGM: &str = r#"<AGMModel><symbol id="1" type="robot"/><symbol id="2" type="room">
    <attribute key="imName" value="kitchen"/></symbol><link src="1" dst="2" label="in"/></AGMModel>"#;

fn transaction() -> Transaction {
    let world = dsr::interchange::read(GRAPH, &dsr::Schema::open());
    world.unwrap().transaction()
}

#[test]
fn graph_json() {
    withstands(entries::graph_json, GRAPH.as_bytes());
}

#[test]
fn worlds_of_other_systems() {
    withstands(entries::world, ROBOCOMP.as_bytes());
    withstands(entries::world, AGM.as_bytes());
    let inner = |text: &str, from: &str, to: &str| {
        let (_, rest) = text.split_once(from).unwrap();
        rest.rsplit_once(to).unwrap().0.to_owned()
    };
    let graph = inner(ROBOCOMP, "\"DSRModel\":", "}");
    withstands(entries::robocomp, graph.as_bytes());
    let model = inner(AGM, "<AGMModel>", "</AGMModel>");
    withstands(entries::agm, model.as_bytes());
}

#[test]
fn transactions_and_changes() {
    withstands(entries::transaction, &encode_transaction(&transaction()));
    let mut graph = Graph::in_memory(Schema::open());
    let (_, change) = graph
        .commit(&transaction(), "agent", Time::default())
        .unwrap();
    withstands(entries::change, &encode_change(&change));
}

#[test]
fn desks() {
    let owner = (5, 6, "agent");
    let mut short = Transaction::new();
    short.create_node("thing", "n", vec![("text".to_owned(), "abc".into())]);
    let desk = encode_desk(owner, Epoch(7), Time::default(), &short).unwrap();
    // The first word is given.
    let bytes = desk[1..].iter().flat_map(|word| word.to_le_bytes());
    let bytes: Vec<u8> = bytes.collect();
    withstands(entries::desk, &bytes);
}

#[test]
fn requests_and_answers() {
    // A client, its first request, its name and process, a time, and one transaction.
    let mut request = vec![5, 1, 5];
    request.extend(b"agent");
    request.extend([6, 0, 1]);
    request.extend(encode_transaction(&transaction()));
    assert_eq!(dsr::wire::decode_request(&request), Ok(vec![transaction()]));
    withstands(entries::request, &request);
    // Version 7 at time 0 that made node 3, not on disk; and a conflict.
    let mut answer = vec![2, 0, 7, 0, 1, 3, 0, 1, 0, 3];
    answer.extend(b"why");
    let answers = dsr::wire::decode_answer(&answer).unwrap();
    assert!(answers[0].is_ok() && answers[1].is_err());
    withstands(entries::request, &answer);
}

#[test]
fn leases() {
    // End the lease of an epoch and a token; and that it is given, with its place and token.
    assert!(dsr::wire::check_lease_request(&[1, 9, 4]).is_ok());
    assert!(dsr::wire::check_lease_answer(&[0, 1, 2, 3]).is_ok());
    withstands(entries::lease, &[0, 1, 9, 4, 5, 6]);
    withstands(entries::lease, &[0, 1, 2, 3]);
}

#[test]
fn pages_of_hot_attributes() {
    // From the number of slots on: one slot with its sequence, key, epoch, and an f64 of time 9.
    let mut page = vec![0u64; 30];
    page[0] = 1;
    page[14..23].copy_from_slice(&[2, 5, 0, 1, 3, 6 | 1 << 32, 0, 9, 0.5f64.to_bits()]);
    let whole = [&[u64::from_le_bytes(*b"cortexH2"), 1], &page[..]].concat();
    let whole: Vec<u64> = whole.into_iter().chain([0; 2048]).collect();
    let (epoch, node, name) = (dsr::Epoch(3), dsr::NodeId(5), dsr::AttributeId(1));
    let value = dsr::wire::read_hot_page(&whole, epoch, node, name);
    assert_eq!(value, Some(0.5.into()));
    let bytes: Vec<u8> = page.iter().flat_map(|word| word.to_le_bytes()).collect();
    withstands(entries::hot_page, &bytes);
}

#[test]
fn handles_of_large_values() {
    let words = [7u64, 1, 24, 2 | 3 << 32, 0];
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    withstands(entries::large_handle, &bytes);
}

#[test]
fn images() {
    let image = Image::of(&entries::small_graph().snapshot()).unwrap();
    withstands(entries::image, &image.to_bytes());
}

#[test]
fn schema_files() {
    withstands(entries::schema, &shipped("scenarios/src/schema.toml"));
}

#[test]
fn grammars_and_goals() {
    withstands(
        entries::grammar,
        &shipped("scenarios/care-centre/rules.aggl"),
    );
    // Rules with nothing to join their nodes, rules that conflict with each other, all in one line.
    let rule = |index: usize| {
        format!(
            "r{index} : active(1) {{ {{ a:t b:t c:t d:u x->b(l) }} => {{ a:t b:t c:t a->b(m) }} \
             precondition {{ (forall e:t f:u (or (l e f) (not (m f a)))) }} }} \
             s{index} : active(1) {{ {{ a:t b:t c:t d:u }} => {{ a:t b:t a->b(l) }} }} "
        )
    };
    let wide = "name=x\n===\n".to_owned() + &(0..3).map(rule).collect::<String>();
    withstands(entries::grammar, wide.as_bytes());
    let goal =
        b"{ \"robot\":robot r:room \"robot\"->r(in) }\nprecondition { (not \"robot\"->r(at)) }";
    withstands(entries::goal, goal);
}

const PDDL: &str = "(define (domain d) (:requirements :typing :action-costs) (:types room)
    (:predicates (at ?r - room) (door ?a ?b - room)) (:functions (total-cost))
    (:action go :parameters (?a ?b - room) :precondition (and (at ?a) (door ?a ?b))
     :effect (and (not (at ?a)) (at ?b) (increase (total-cost) 1))))\0
    (define (problem p) (:domain d) (:objects k l - room) (:init (at k) (door k l))
     (:goal (at l)) (:metric minimize (total-cost)))";

#[test]
fn tasks_in_pddl() {
    let (domain, problem) = PDDL.split_once('\0').unwrap();
    let [domain, problem] = [domain, problem].map(|text| grammar::SourceFile::new("task", text));
    assert!(executive::pddl::read(&domain, &problem).is_ok());
    withstands(entries::pddl, PDDL.as_bytes());
}

#[test]
fn manifests() {
    withstands(
        entries::manifest,
        &shipped("src/manifests/social_mapping.toml"),
    );
}

#[test]
fn maps_and_recordings() {
    let map = "type octile\nheight 2\nwidth 3\nmap\n.@.\n...\n";
    assert!(scenarios::grid_file::parse_map("a.map", map).is_ok());
    withstands(entries::recording, map.as_bytes());
    let tracks = "0 1 1.0 0 2.0 0.5 0 0.5\n10 1 1.5 0 2.5 0.5 0 0.5\n";
    assert!(scenarios::Tracks::parse("obsmat.txt", tracks).is_ok());
    withstands(entries::recording, tracks.as_bytes());
}

#[test]
fn scenario_files() {
    withstands(
        entries::scenario,
        &shipped("scenarios/care-centre/scenario.toml"),
    );
}

#[test]
fn a_graphs_memory() {
    let whole = dsr::Snapshot::of_words(&entries::small_graph().words()).unwrap();
    let count = entries::read(&whole).unwrap();
    assert!(count > 600, "{count} things in it");
    // What is likely to lead somewhere: small numbers, addresses, links, counts.
    let word = prop_oneof![
        3 => 0..200_000u64,
        2 => (0..400_000u64).prop_map(|address| address << 1 | 1),
        1 => (0..64u64, 0..64u64).prop_map(|(low, high)| low | high << 32),
        1 => any::<u64>(),
    ];
    let change = (0..1u32 << 24, word).prop_map(|(place, word)| {
        let mut bytes = place.to_le_bytes()[..3].to_vec();
        bytes.extend(word.to_le_bytes());
        bytes
    });
    let changes = prop::collection::vec(change, 1..12);
    TestRunner::new(rounds(400))
        .run(&changes, |changes| {
            entries::arena(&changes.concat());
            Ok(())
        })
        .unwrap();
}
