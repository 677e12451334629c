//! R(t) at other times than now, for who looks at the agenda. This file guarantees that it comes from the same
//! settings, objects and activities as the map.

use super::read::contents;
use super::settings::Settings;
use crate::social_mapping::config::SocialConfig;
use crate::social_mapping::map::SocialMapper;
use dsr::{ReadError, Snapshot, Time};
use std::collections::BTreeMap;

/// R(t) of each object that has a space, by its name, at each of the times, by the settings and the agenda
/// that the graph has. Settings that cannot be used count as none.
///
/// # Errors
/// [`ReadError`].
pub fn usages(
    snapshot: &Snapshot,
    times: &[Time],
) -> Result<BTreeMap<String, Vec<f64>>, ReadError> {
    let given = Settings::default().read(snapshot)?;
    let usual = || SocialMapper::new(SocialConfig::default()).ok();
    let Some(mapper) = given.or_else(usual) else {
        return Ok(BTreeMap::new());
    };
    let scene = contents(snapshot, mapper.config())?;
    Ok(mapper.usages(&scene, times))
}
