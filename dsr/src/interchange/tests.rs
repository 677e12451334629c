//! Worlds of other systems: what comes in, what is refused and where, and that nothing panics.

use super::*;
use crate::{Graph, Schema, Snapshot, Time};
use proptest::prelude::*;

mod agm;
mod out;
mod problems;
mod robocomp;

fn world(text: &str) -> Snapshot {
    let world = read(text, &Schema::open()).unwrap_or_else(|error| panic!("{error}"));
    let mut graph = Graph::in_memory(Schema::open());
    graph.import(&world, "file", Time::default()).unwrap();
    graph.snapshot()
}

fn refused(text: &str) -> String {
    read(text, &Schema::open()).unwrap_err().to_string()
}

const ROBOCOMP: &str = r#"{"DSRModel":{"symbols":{
 "100":{"id":"100","type":"root","name":"root","attribute":{
   "t0":{"type":0,"value":"SeaGreen"},
   "t1":{"type":1,"value":-2147483648},
   "t2":{"type":2,"value":71.272423},
   "t3":{"type":3,"value":[0,0.1,-4.886917963631277e-07]},
   "t4":{"type":4,"value":true,"timestamp":1700000000123456789,"agent_id":12},
   "t5":{"type":5,"value":[0,128,255]},
   "t6":{"type":6,"value":4294967295},
   "t7":{"type":7,"value":"18446744073709551615"},
   "t8":{"type":8,"value":0.1},
   "t9":{"type":9,"value":["18446744073709551615",3]},
   "t10":{"type":10,"value":[1,2]},
   "t11":{"type":11,"value":[1,2,3]},
   "t12":{"type":12,"value":[1,2,3,4]},
   "t13":{"type":13,"value":[1,2,3,4,5,0.6]}},
  "links":[{"src":"100","dst":"200","label":"RT","linkAttribute":{
   "rt_translation":{"type":3,"value":[10,0,-2.5]}}}]},
 "200":{"id":200,"type":"omnirobot","name":"robot","attribute":{},"links":[]}}}}"#;

const AGM: &str = r#"<?xml version="1.0"?>
<AGMModel>
  <!-- links may come first -->
  <link src="1" dst="3" label="in" enabled="true"/>
  <symbol id="1" type="robot"><attribute key="imName" value="shelly"/></symbol>
  <symbol id="3" type="room">
    <attribute key="imName" value="room"/>
    <attribute key="polyline" value="-8500 2500;-3500 2500"/>
  </symbol>
  <symbol id="4" type="room"><attribute key="imName" value="room"/></symbol>
  <symbol id="door_a" type="door"/>
  <link src="3" dst="door_a" label="RT"><linkAttribute key="tx" value="-7500"/></link>
</AGMModel>"#;

#[test]
fn deep_nesting_is_no_way_to_exhaust_the_stack() {
    let depth = 200_000;
    let xml = format!(
        "{}{}",
        "<AGMModel>".repeat(depth),
        "</AGMModel>".repeat(depth)
    );
    assert!(read(&xml, &Schema::open()).is_err());
    let json = format!(
        "{{\"DSRModel\":{}{}}}",
        "[".repeat(depth),
        "]".repeat(depth)
    );
    assert!(read(&json, &Schema::open()).is_err());
}

/// A text with a few of its characters taken out, doubled or replaced.
fn mutated(text: &'static str) -> impl Strategy<Value = String> {
    let edit = (any::<prop::sample::Index>(), 0..3u8, any::<char>());
    prop::collection::vec(edit, 0..6).prop_map(move |edits| {
        let mut letters: Vec<char> = text.chars().collect();
        for (place, kind, letter) in edits {
            let place = place.index(letters.len());
            match kind {
                0 => drop(letters.remove(place)),
                1 => letters.insert(place, letters[place]),
                _ => letters[place] = letter,
            }
        }
        letters.into_iter().collect()
    })
}

proptest! {
    #[test]
    fn no_mutated_robocomp_file_panics(text in mutated(ROBOCOMP)) {
        commit_or_refuse(&text)?;
    }

    #[test]
    fn no_mutated_agm_model_panics(text in mutated(AGM)) {
        commit_or_refuse(&text)?;
    }
}

/// Reads a text and, where that works, makes the world; a refusal says something.
fn commit_or_refuse(text: &str) -> Result<(), TestCaseError> {
    match read(text, &Schema::open()) {
        Err(error) => {
            prop_assert!(!error.to_string().is_empty());
            // Every place lies in the text and on the borders of letters.
            for problem in &error.problems {
                prop_assert!(
                    text.get(problem.span.clone().unwrap()).is_some(),
                    "{problem:?}"
                );
            }
        }
        Ok(world) => {
            let mut graph = Graph::in_memory(Schema::open());
            if let Err(refusal) = graph.import(&world, "test", Time::default()) {
                prop_assert!(!refusal.to_string().is_empty());
            }
        }
    }
    Ok(())
}
