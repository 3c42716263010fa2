// Sample index → point: twin of src/engine/generated/points.rs. `numbers` holds means and deviations as bits.

// Blocks of four words per draw.
const BLOCKS: u32 = 4u;

const SOURCE_RANDOM: u32 = 0u;
const SOURCE_GIVEN: u32 = 1u;

// SOURCE_…
override points_source: u32;

struct Drawn {
    values: array<f32, MAX_PARAMETERS>,
    tries: u32,
    component: u32,
}

// The number at an index of the shared table.
fn number(at: u32) -> f32 {
    return bitcast<f32>(numbers[at]);
}

// The first valid draw of an index.
fn draw_point(index: vec2<u32>) -> Drawn {
    let attempts = select(1u, ATTEMPTS, points_source == SOURCE_RANDOM);
    var drawn: Drawn;
    for (var attempt = 0u; attempt < attempts; attempt++) {
        drawn = candidate(index, attempt);
        if is_valid(drawn.values) {
            return drawn;
        }
    }
    drawn.tries = ATTEMPTS + 1u;
    return drawn;
}

// Draw `attempt` of an index, valid or not. Word 0 selects the component, word 1 is unused, the others give normal deviates.
fn candidate(index: vec2<u32>, attempt: u32) -> Drawn {
    let d = recipe_dimensions;
    var words: array<u32, 16>;
    if points_source == SOURCE_GIVEN {
        var given: array<f32, MAX_PARAMETERS>;
        // A plan has no index beyond the points.
        for (var j = 0u; j < recipe_dimensions; j++) {
            given[j] = number(generation.first_mean + index.x * d + j);
        }
        return Drawn(given, attempt + 1u, 0u);
    }
    let seed = vec2<u32>(generation.seed_low, generation.seed_high);
    for (var block = 0u; 4u * block < 2u + recipe_dimensions; block++) {
        let four = stream_words(seed, generation.purpose, index, attempt * BLOCKS + block);
        words[4u * block] = four.x;
        words[4u * block + 1u] = four.y;
        words[4u * block + 2u] = four.z;
        words[4u * block + 3u] = four.w;
    }
    let component = choose(words[0], generation.components);
    let mean = generation.first_mean + component * d;
    var values: array<f32, MAX_PARAMETERS>;
    for (var j = 0u; j < recipe_dimensions; j++) {
        values[j] = number(mean + j) + number(generation.first_deviation + j) * standard_normal(words[2u + j]);
    }
    return Drawn(values, attempt + 1u, component);
}
