//! Randomness by purpose. Each camera, sensor and crowd draws from a stream of its own, so that
//! adding one changes nothing for the others.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// The random numbers of one purpose in a world with this seed.
pub(super) fn stream(seed: u64, purpose: &str) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(fnv1a(purpose));
    random
}

/// A draw from the normal distribution of mean 0 and this standard deviation.
pub(super) fn normal(random: &mut ChaCha8Rng, deviation: f64) -> f64 {
    let draw: f64 = StandardNormal.sample(random);
    draw * deviation
}

/// The 64-bit FNV-1a hash: fixed for ever, which the standard hasher does not promise.
fn fnv1a(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn purposes_differ_and_each_repeats() {
        let draw = |seed, purpose| stream(seed, purpose).random::<u64>();
        assert_eq!(draw(7, "laser"), draw(7, "laser"));
        assert_ne!(draw(7, "laser"), draw(7, "camera/a"));
        assert_ne!(draw(7, "laser"), draw(8, "laser"));
    }

    #[test]
    fn the_hash_is_fnv1a() {
        assert_eq!(fnv1a("a"), 0xaf63_dc4c_8601_ec8c);
    }
}
