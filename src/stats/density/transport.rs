//! Distances between sets of points. W: the exact optimal transport between two sets of points with equal weights and Euclidean distance
//! (Wasserstein distance of order 1).
//!
//! Masses are integers (each point of one set has the size of the other set over their greatest common divisor), so
//! flows are exact and only costs are rounded. Solved by successive shortest paths with potentials on the dense
//! bipartite graph (Edmonds and Karp 1972; Jonker and Volgenant 1987 for equal sizes).

/// W between sets of points, each of d numbers. 0 if both sets are empty; infinite if one is.
pub fn wasserstein(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    match (a.is_empty(), b.is_empty()) {
        (true, true) => return 0.0,
        (false, false) => {}
        _ => return f64::INFINITY,
    }
    let cost: Vec<f64> = a.iter().flat_map(|p| b.iter().map(move |q| distance(p, q))).collect();
    let mut transport = Transport::new(cost, a.len(), b.len());
    transport.solve();
    transport.mean_cost()
}

fn distance(p: &[f64], q: &[f64]) -> f64 {
    p.iter().zip(q).map(|(p, q)| (p - q) * (p - q)).sum::<f64>().sqrt()
}

/// Mean distance between the points of two sets.
pub(super) fn mean_distance(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    a.iter().flat_map(|p| b.iter().map(|q| distance(p, q))).sum::<f64>() / (a.len() * b.len()) as f64
}

/// Maximum number of iterations of [`sinkhorn`].
const ITERATIONS: usize = 1000;
/// Change of the potentials, relative to ε, that ends the iterations.
const PRECISION: f64 = 1e-6;

/// Sinkhorn divergence between two sets of points with equal weights and Euclidean distance: the transport with entropic
/// regularization ε > 0, less half of that of each set to itself. It is 0 for equal sets, and W for ε → 0 (Feydy et al.,
/// "Interpolating between optimal transport and MMD using Sinkhorn divergences", AISTATS 2019).
pub(super) fn sinkhorn(a: &[Vec<f64>], b: &[Vec<f64>], epsilon: f64) -> f64 {
    regularized(a, b, epsilon) - 0.5 * (regularized(a, a, epsilon) + regularized(b, b, epsilon))
}

/// The dual value of the regularized transport, by alternating updates of its potentials in the log domain.
fn regularized(a: &[Vec<f64>], b: &[Vec<f64>], epsilon: f64) -> f64 {
    let cost: Vec<Vec<f64>> = a.iter().map(|p| b.iter().map(|q| distance(p, q) / epsilon).collect()).collect();
    let across: Vec<Vec<f64>> = (0..b.len()).map(|j| cost.iter().map(|row| row[j]).collect()).collect();
    // −ln of the mean of exp(potential − cost), row by row.
    let update = |cost: &[Vec<f64>], potential: &[f64]| -> Vec<f64> {
        let of_row = |row: &Vec<f64>| {
            let parts = || row.iter().zip(potential).map(|(cost, potential)| potential - cost);
            let top = parts().fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = parts().map(|part| libm::exp(part - top)).sum();
            libm::log(row.len() as f64) - top - libm::log(sum)
        };
        cost.iter().map(of_row).collect()
    };
    let mut of_a = vec![0.0; a.len()];
    let mut of_b = vec![0.0; b.len()];
    for _ in 0..ITERATIONS {
        of_b = update(&across, &of_a);
        let next = update(&cost, &of_b);
        let change = next.iter().zip(&of_a).map(|(new, old)| (new - old).abs()).fold(0.0, f64::max);
        of_a = next;
        if change < PRECISION {
            break;
        }
    }
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    epsilon * (mean(&of_a) + mean(&of_b))
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

struct Transport {
    rows: usize,
    columns: usize,
    /// rows × columns.
    cost: Vec<f64>,
    flow: Vec<u64>,
    /// Remaining mass of a row to send, and of a column to fill.
    supply: Vec<u64>,
    demand: Vec<u64>,
    row_potential: Vec<f64>,
    column_potential: Vec<f64>,
}

/// A shortest path tree, grown from one row until a column with demand is reached.
struct Tree {
    row_distance: Vec<f64>,
    column_distance: Vec<f64>,
    row_done: Vec<bool>,
    column_done: Vec<bool>,
    /// Predecessor: the column before a row, the row before a column.
    before_row: Vec<usize>,
    before_column: Vec<usize>,
}

impl Transport {
    fn new(cost: Vec<f64>, rows: usize, columns: usize) -> Transport {
        let divisor = greatest_common_divisor(rows, columns);
        // Column reduction: every column has an arc of reduced cost 0, and none is negative.
        let column_potential =
            (0..columns).map(|j| (0..rows).map(|i| cost[i * columns + j]).fold(f64::INFINITY, f64::min)).collect();
        Transport {
            rows,
            columns,
            flow: vec![0; rows * columns],
            cost,
            supply: vec![(columns / divisor) as u64; rows],
            demand: vec![(rows / divisor) as u64; columns],
            row_potential: vec![0.0; rows],
            column_potential,
        }
    }

    fn reduced(&self, row: usize, column: usize) -> f64 {
        // Rounding may give a slightly negative cost, which a shortest path must not use.
        (self.cost[row * self.columns + column] - self.row_potential[row] - self.column_potential[column]).max(0.0)
    }

    fn solve(&mut self) {
        for source in 0..self.rows {
            while self.supply[source] > 0 {
                self.send(source);
            }
        }
    }

    /// Sends mass from a row along a shortest path to the nearest column with demand.
    fn send(&mut self, source: usize) {
        let mut tree = Tree {
            row_distance: vec![f64::INFINITY; self.rows],
            column_distance: vec![f64::INFINITY; self.columns],
            row_done: vec![false; self.rows],
            column_done: vec![false; self.columns],
            before_row: vec![usize::MAX; self.rows],
            before_column: vec![usize::MAX; self.columns],
        };
        tree.row_distance[source] = 0.0;
        let mut open_rows = vec![source];
        let (end, length) = loop {
            for row in open_rows.drain(..) {
                tree.row_done[row] = true;
                for column in 0..self.columns {
                    let distance = tree.row_distance[row] + self.reduced(row, column);
                    if !tree.column_done[column] && distance < tree.column_distance[column] {
                        tree.column_distance[column] = distance;
                        tree.before_column[column] = row;
                    }
                }
            }
            // Demand exists as long as supply does, and every column is reachable.
            let open = (0..self.columns).filter(|j| !tree.column_done[*j]);
            let Some(column) = open.min_by(|i, j| tree.column_distance[*i].total_cmp(&tree.column_distance[*j])) else {
                self.supply[source] = 0;
                return;
            };
            let distance = tree.column_distance[column];
            tree.column_done[column] = true;
            if self.demand[column] > 0 {
                break (column, distance);
            }
            // Arcs that carry flow have reduced cost 0 backwards.
            for row in 0..self.rows {
                if !tree.row_done[row] && self.flow[row * self.columns + column] > 0 {
                    tree.row_distance[row] = distance;
                    tree.before_row[row] = column;
                    tree.row_done[row] = true;
                    open_rows.push(row);
                }
            }
        };
        for row in (0..self.rows).filter(|i| tree.row_done[*i]) {
            self.row_potential[row] += length - tree.row_distance[row];
        }
        for column in (0..self.columns).filter(|j| tree.column_done[*j]) {
            self.column_potential[column] -= length - tree.column_distance[column];
        }
        self.augment(source, end, &tree);
    }

    fn augment(&mut self, source: usize, end: usize, tree: &Tree) {
        let mut amount = self.supply[source].min(self.demand[end]);
        let mut column = end;
        loop {
            let row = tree.before_column[column];
            if row == source {
                break;
            }
            column = tree.before_row[row];
            amount = amount.min(self.flow[row * self.columns + column]);
        }
        self.supply[source] -= amount;
        self.demand[end] -= amount;
        let mut column = end;
        loop {
            let row = tree.before_column[column];
            self.flow[row * self.columns + column] += amount;
            if row == source {
                break;
            }
            column = tree.before_row[row];
            self.flow[row * self.columns + column] -= amount;
        }
    }

    fn mean_cost(&self) -> f64 {
        let mass: u64 = self.flow.iter().sum();
        self.flow.iter().zip(&self.cost).map(|(f, c)| *f as f64 * c).sum::<f64>() / mass as f64
    }
}

#[cfg(test)]
mod tests {
    use super::{sinkhorn, wasserstein};

    fn line(values: &[f64]) -> Vec<Vec<f64>> {
        values.iter().map(|v| vec![*v]).collect()
    }

    #[test]
    fn on_a_line_transport_is_the_area_between_the_distribution_functions() {
        // 0 with mass 1 against 1 and 3 with half each.
        assert!((wasserstein(&line(&[0.0]), &line(&[1.0, 3.0])) - 2.0).abs() < 1e-15);
        let (a, b) = (line(&[0.3, -1.2, 4.0, 2.5, 0.0, 7.0]), line(&[1.0, 2.0, -3.0, 0.5]));
        let area = {
            let share = |set: &[Vec<f64>], x: f64| set.iter().filter(|v| v[0] <= x).count() as f64 / set.len() as f64;
            let mut ends: Vec<f64> = a.iter().chain(&b).map(|v| v[0]).collect();
            ends.sort_by(f64::total_cmp);
            ends.windows(2).map(|w| (w[1] - w[0]) * (share(&a, w[0]) - share(&b, w[0])).abs()).sum::<f64>()
        };
        assert!((wasserstein(&a, &b) - area).abs() < 1e-14);
        assert!((wasserstein(&b, &a) - area).abs() < 1e-14);
    }

    #[test]
    fn a_sinkhorn_divergence_is_0_for_equal_sets_and_w_for_a_small_epsilon() {
        let a = vec![vec![1.0, 2.0], vec![-3.0, 0.5], vec![4.0, 4.0], vec![0.0, 1.0]];
        let b = vec![vec![0.5, 2.5], vec![-2.0, 0.0], vec![6.0, 4.0]];
        let w = wasserstein(&a, &b);
        assert!(sinkhorn(&a, &a, 0.5).abs() < 1e-9);
        assert!((sinkhorn(&a, &b, 0.05) / w - 1.0).abs() < 0.02);
        let wide = sinkhorn(&a, &b, 1.0);
        assert!(wide > 0.0 && wide < w && (wide - sinkhorn(&b, &a, 1.0)).abs() < 1e-4 * w, "{wide}");
    }

    #[test]
    fn a_set_is_at_distance_0_from_its_permutation_and_from_itself_twice() {
        let a = vec![vec![1.0, 2.0], vec![-3.0, 0.5], vec![4.0, 4.0]];
        let b = vec![a[2].clone(), a[0].clone(), a[1].clone()];
        assert_eq!(wasserstein(&a, &b), 0.0);
        assert_eq!(wasserstein(&a, &[b.clone(), b].concat()), 0.0);
    }
}
