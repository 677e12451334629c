//! The settings that somebody enters at the world while the system runs. This file guarantees that what cannot be
//! used changes nothing: those that were in force stay in force until it is mended.

use super::read::bounds;
use super::{SCENARIO_SETTINGS, SETTINGS};
use crate::social_mapping::config::SocialConfig;
use crate::social_mapping::map::SocialMapper;
use crate::social_mapping::rejection::Rejection;
use crate::social_mapping::scene::check_size;
use dsr::{Node, ReadError, Snapshot, Value};
use serde_json::Map;

/// The type whose descendants are the classes of objects.
const OBJECT: &str = "object";

/// What was read last.
#[derive(Debug, Clone, Default)]
pub(super) struct Settings {
    given: Given,
    refused: Vec<Rejection>,
    /// Whether they were refused for names or bounds, which the graph may have otherwise later.
    for_graph: bool,
}

/// What stands at the world.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Given {
    scenario: Option<String>,
    settings: Option<String>,
}

impl Given {
    fn read(world: &Node<'_>) -> Result<Self, ReadError> {
        let text = |name| -> Result<Option<String>, ReadError> {
            let value = world.value(name)?;
            Ok(value.as_ref().and_then(Value::as_str).map(str::to_owned))
        };
        Ok(Self {
            scenario: text(SCENARIO_SETTINGS)?,
            settings: text(SETTINGS)?,
        })
    }

    /// The settings laid over the scenario's, key by key.
    fn config(&self) -> Result<SocialConfig, serde_json::Error> {
        let fields = |text: &Option<String>| -> Result<Map<String, _>, serde_json::Error> {
            let text = text.as_deref().unwrap_or("{}");
            // By themselves first: then what is wrong is told with its place in the text.
            serde_json::from_str::<SocialConfig>(text)?;
            serde_json::from_str(text)
        };
        let mut all = fields(&self.scenario)?;
        all.extend(fields(&self.settings)?);
        serde_json::from_value(serde_json::Value::Object(all))
    }
}

impl Settings {
    /// What is wrong with those that stand in the graph.
    pub(super) fn refused(&self) -> &[Rejection] {
        &self.refused
    }

    /// A mapper with the world's settings, where these changed and can be used.
    pub(super) fn read(&mut self, snapshot: &Snapshot) -> Result<Option<SocialMapper>, ReadError> {
        let Some(world) = snapshot.nodes_of("world").next().transpose()? else {
            return Ok(None);
        };
        let given = Given::read(&world)?;
        if given == self.given && !self.for_graph {
            return Ok(None);
        }
        self.given = given;
        self.for_graph = false;
        let config = match self.given.config() {
            Ok(config) => config,
            Err(error) => {
                let problem = error.to_string();
                self.refused = vec![Rejection::Settings { problem }];
                return Ok(None);
            }
        };
        let mut problems = config.problems();
        let mut too_large = None;
        if problems.is_empty() {
            problems = config.unknown_names(&rooms(snapshot)?, classes(snapshot).as_deref());
            // Bounds that cannot be read are the scene's to complain of.
            let bounds = bounds(&world).ok();
            too_large = bounds.and_then(|bounds| check_size(bounds, config.resolution).err());
            self.for_graph = !problems.is_empty() || too_large.is_some();
        }
        let figures = problems
            .iter()
            .map(|problem| format!("{} {}", problem.field, problem.requirement));
        let told = figures.chain(too_large.map(|error| error.to_string()));
        self.refused = told
            .map(|problem| Rejection::Settings { problem })
            .collect();
        Ok(if self.refused.is_empty() {
            SocialMapper::new(config).ok()
        } else {
            None
        })
    }
}

fn rooms(snapshot: &Snapshot) -> Result<Vec<String>, ReadError> {
    snapshot.nodes_of("room").map(|room| room?.name()).collect()
}

/// The classes of objects that there may be; `None` where the schema takes any.
fn classes(snapshot: &Snapshot) -> Option<Vec<&str>> {
    let schema = snapshot.schema();
    let object = schema.find_type(OBJECT)?;
    let all = schema.subtypes(object).iter();
    (!schema.is_open()).then(|| all.map(|class| schema.type_name(*class)).collect())
}
