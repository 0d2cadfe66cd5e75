// The normal equations of the deformation graph: six unknowns per node, a rotation vector and a
// translation.
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <tuple>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/motion/deformation_graph.h"

namespace v3d::recon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Block = Eigen::Matrix<double, 6, 6>;
using Part = Eigen::Matrix<double, 6, 1>;

/// Targets are added in this number of fixed shares, so that the sums do not depend on threads.
constexpr size_t kShares = 8;
/// Weight of "no motion" for each unknown, so that nodes without targets are determined.
constexpr double kDamping = 1e-6;
/// Nodes that one thread handles at a time.
constexpr size_t kNodes = 64;
/// Residual of a step, relative to its right-hand side. The next step corrects it.
constexpr double kTolerance = 1e-3;
constexpr int kMaxIterations = 400;
/// Deviation from a rigid motion from which an edge yields, metres.
constexpr double kYieldM = 0.002;

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Vector3d rotation_vector(const Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Matrix3d rotation_of(const Vector3d& vector) {
  const double angle = vector.norm();
  return angle > 0 ? Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix()
                   : Matrix3d::Identity();
}

/// Symmetric matrix of 6 x 6 blocks and right-hand side. Only blocks of a row at or below its
/// column exist.
struct Equations {
  std::vector<Block> blocks;
  std::vector<Part> right;
  void clear(size_t count, size_t nodes) {
    blocks.assign(count, Block::Zero());
    right.assign(nodes, Part::Zero());
  }
};

}  // namespace

class GraphSolver::Impl {
 public:
  Impl(const DeformationGraph& graph, const std::vector<Eigen::Vector3f>& rest)
      : graph_(graph), rest_(rest) {
    find_blocks();
    make_rows();
  }

  void solve(std::span<const VertexTarget> targets, const GraphSolverOptions& options,
             std::vector<NodeMotion>& motion) {
    V3D_CHECK(motion.size() == graph_.nodes());
    for (int i = 0; i < options.iterations; ++i) {
      add_targets(targets, motion);
      add_edges(options, motion);
      step(motion);
    }
  }

 private:
  /// The blocks of all pairs of nodes that share a vertex: those of the edges, and the diagonal.
  void find_blocks() {
    const size_t nodes = graph_.nodes();
    std::vector<std::vector<uint32_t>> below(nodes);
    for (const DeformationGraph::Edge& edge : graph_.edges()) below[edge.a].push_back(edge.b);
    first_.assign(nodes + 1, 0);
    for (uint32_t a = 0; a < nodes; ++a) {
      below[a].push_back(a);
      std::sort(below[a].begin(), below[a].end());
      first_[a + 1] = first_[a] + static_cast<uint32_t>(below[a].size());
      rows_.insert(rows_.end(), below[a].begin(), below[a].end());
    }
  }

  /// Number of the block of column `a` and row `b`. Requires a <= b.
  size_t block_of(uint32_t a, uint32_t b) const {
    const auto begin = rows_.begin() + first_[a], end = rows_.begin() + first_[a + 1];
    const auto found = std::lower_bound(begin, end, b);
    V3D_CHECK(found != end && *found == b);
    return static_cast<size_t>(found - rows_.begin());
  }

  /// The blocks of each row of the matrix, also those that only their transpose stores.
  void make_rows() {
    std::vector<std::vector<Entry>> entries(graph_.nodes());
    for (uint32_t a = 0; a < graph_.nodes(); ++a) {
      for (uint32_t k = first_[a]; k < first_[a + 1]; ++k) {
        entries[rows_[k]].push_back({a, k, false});
        if (rows_[k] != a) entries[a].push_back({rows_[k], k, true});
      }
    }
    row_begin_.assign(1, 0);
    for (const std::vector<Entry>& row : entries) {
      row_.insert(row_.end(), row.begin(), row.end());
      row_begin_.push_back(row_.size());
    }
  }

  void add_targets(std::span<const VertexTarget> targets, const std::vector<NodeMotion>& motion) {
    tbb::parallel_for(size_t{0}, kShares, [&](size_t share) {
      Equations& sum = shares_[share];
      sum.clear(rows_.size(), graph_.nodes());
      const size_t begin = targets.size() * share / kShares;
      const size_t end = targets.size() * (share + 1) / kShares;
      for (size_t i = begin; i < end; ++i) add(targets[i], motion, sum);
    });
    Equations& all = shares_[0];
    for (size_t share = 1; share < kShares; ++share) {
      for (size_t k = 0; k < all.blocks.size(); ++k) all.blocks[k] += shares_[share].blocks[k];
      for (size_t n = 0; n < all.right.size(); ++n) all.right[n] += shares_[share].right[n];
    }
  }

  void add(const VertexTarget& target, const std::vector<NodeMotion>& motion,
           Equations& sum) const {
    const DeformationGraph::Influence& influence = graph_.influences()[target.vertex];
    const Vector3d direction = target.direction.cast<double>();
    const Vector3d rest = rest_[target.vertex].cast<double>();
    std::array<Part, DeformationGraph::kInfluences> jacobian;
    Vector3d position = Vector3d::Zero();
    for (size_t k = 0; k < jacobian.size(); ++k) {
      const uint32_t node = influence.node[k];
      const double weight = influence.weight[k];
      const Vector3d arm = motion[node].rotation * (rest - graph_.rest()[node]);
      position += weight * (arm + motion[node].position);
      jacobian[k] << weight * arm.cross(direction), weight * direction;
    }
    const double residual = direction.dot(target.target.cast<double>() - position);
    for (size_t i = 0; i < jacobian.size(); ++i) {
      if (influence.weight[i] == 0) continue;
      sum.right[influence.node[i]] += double{target.weight} * residual * jacobian[i];
      for (size_t k = 0; k < jacobian.size(); ++k) {
        if (influence.weight[k] == 0 || influence.node[k] < influence.node[i]) continue;
        sum.blocks[block_of(influence.node[i], influence.node[k])].noalias() +=
            double{target.weight} * jacobian[k] * jacobian[i].transpose();
      }
    }
  }

  void add_edges(const GraphSolverOptions& options, const std::vector<NodeMotion>& motion) {
    Equations& sum = shares_[0];
    const double lever = graph_.spacing_m();
    for (const DeformationGraph::Edge& edge : graph_.edges()) {
      const NodeMotion& a = motion[edge.a];
      const NodeMotion& b = motion[edge.b];
      const Vector3d rest = graph_.rest()[edge.b] - graph_.rest()[edge.a];
      // Huber's weight: few edges bend much, at joints and folds, and most stay rigid.
      const double bend = std::max((a.rotation * rest + a.position - b.position).norm(),
                                   (b.rotation * rest + a.position - b.position).norm());
      const double yields = bend > kYieldM ? kYieldM / bend : 1;
      const double rigidity = options.rigidity * edge.stiffness * yields;
      // Each node predicts the position of the other one.
      add_prediction(edge.a, edge.b, a.rotation * rest, b.position - a.position, rigidity, sum);
      add_prediction(edge.b, edge.a, b.rotation * -rest, a.position - b.position, rigidity, sum);
      const double bending = options.bending * edge.stiffness * yields * lever * lever;
      add_rotation(edge.a, edge.b, rotation_vector(b.rotation * a.rotation.transpose()), bending,
                   sum);
    }
  }

  /// Node `from` predicts `arm` from itself to node `to`, which is at `found`.
  void add_prediction(uint32_t from, uint32_t to, const Vector3d& arm, const Vector3d& found,
                      double weight, Equations& sum) const {
    // residual = found - arm; change of arm = -[arm]x w_from; change of found = d_to - d_from.
    Eigen::Matrix<double, 3, 6> of_from, of_to;
    of_from << cross_matrix(arm), -Matrix3d::Identity();
    of_to << Matrix3d::Zero(), Matrix3d::Identity();
    add_pair(from, to, of_from, of_to, arm - found, weight, sum);
  }

  /// The nodes turn by the same rotation; `between` turns `a` into `b`.
  void add_rotation(uint32_t a, uint32_t b, const Vector3d& between, double weight,
                    Equations& sum) const {
    Eigen::Matrix<double, 3, 6> of_a, of_b;
    of_a << -Matrix3d::Identity(), Matrix3d::Zero();
    of_b << Matrix3d::Identity(), Matrix3d::Zero();
    add_pair(a, b, of_a, of_b, -between, weight, sum);
  }

  /// Adds weight * |of_a x_a + of_b x_b - wanted|^2.
  void add_pair(uint32_t a, uint32_t b, const Eigen::Matrix<double, 3, 6>& of_a,
                const Eigen::Matrix<double, 3, 6>& of_b, const Vector3d& wanted, double weight,
                Equations& sum) const {
    sum.blocks[block_of(a, a)] += weight * of_a.transpose() * of_a;
    sum.blocks[block_of(b, b)] += weight * of_b.transpose() * of_b;
    if (a < b) {
      sum.blocks[block_of(a, b)] += weight * of_b.transpose() * of_a;
    } else {
      sum.blocks[block_of(b, a)] += weight * of_a.transpose() * of_b;
    }
    sum.right[a] += weight * of_a.transpose() * wanted;
    sum.right[b] += weight * of_b.transpose() * wanted;
  }

  void step(std::vector<NodeMotion>& motion) {
    conjugate_gradients();
    for (size_t n = 0; n < graph_.nodes(); ++n) {
      motion[n].rotation = rotation_of(change_[n].head<3>()) * motion[n].rotation;
      motion[n].position += change_[n].tail<3>();
    }
  }

  /// Solves the equations for `change_`, preconditioned by the blocks of the diagonal. The solver
  /// of Eigen runs on one core, and a Cholesky factorisation has five times as many entries.
  void conjugate_gradients() {
    Equations& sum = shares_[0];
    const size_t nodes = graph_.nodes();
    inverse_.resize(nodes);
    residual_ = sum.right;
    change_.assign(nodes, Part::Zero());
    search_.resize(nodes);
    product_.resize(nodes);
    for_each_block<kNodes>(nodes, [&](size_t begin, size_t end) {
      for (size_t n = begin; n < end; ++n) {
        const auto node = static_cast<uint32_t>(n);
        Block& diagonal = sum.blocks[block_of(node, node)];
        diagonal.diagonal().array() += kDamping;
        inverse_[n] = diagonal.inverse();
        search_[n] = inverse_[n] * residual_[n];
      }
    });
    double energy = dot(residual_, search_);
    const double enough = kTolerance * kTolerance * dot(residual_, residual_);
    for (int i = 0; i < kMaxIterations && energy > 0; ++i) {
      multiply(sum.blocks);
      const double length = energy / dot(search_, product_);
      double left = 0, next = 0;
      std::tie(left, next) = advance(length);
      if (left <= enough) break;
      const double keep = next / energy;
      energy = next;
      for_each_block<kNodes>(nodes, [&](size_t begin, size_t end) {
        for (size_t n = begin; n < end; ++n) {
          search_[n] = inverse_[n] * residual_[n] + keep * search_[n];
        }
      });
    }
  }

  /// product = matrix * search.
  void multiply(const std::vector<Block>& blocks) {
    for_each_block<kNodes>(graph_.nodes(), [&](size_t begin, size_t end) {
      for (size_t n = begin; n < end; ++n) {
        Part row = Part::Zero();
        for (size_t k = row_begin_[n]; k < row_begin_[n + 1]; ++k) {
          const Entry& entry = row_[k];
          if (entry.transposed) {
            row.noalias() += blocks[entry.block].transpose() * search_[entry.node];
          } else {
            row.noalias() += blocks[entry.block] * search_[entry.node];
          }
        }
        product_[n] = row;
      }
    });
  }

  /// Moves along the search direction. Returns the square of the residual, and its energy under the
  /// preconditioner.
  std::pair<double, double> advance(double length) {
    const size_t count = (graph_.nodes() + kNodes - 1) / kNodes;
    std::vector<std::pair<double, double>> sums(count, {0, 0});
    for_each_block<kNodes>(graph_.nodes(), [&](size_t begin, size_t end) {
      auto& [square, energy] = sums[begin / kNodes];
      for (size_t n = begin; n < end; ++n) {
        change_[n] += length * search_[n];
        residual_[n] -= length * product_[n];
        square += residual_[n].squaredNorm();
        energy += residual_[n].dot(inverse_[n] * residual_[n]);
      }
    });
    std::pair<double, double> sum{0, 0};
    for (const auto& [square, energy] : sums) {
      sum.first += square;
      sum.second += energy;
    }
    return sum;
  }

  static double dot(const std::vector<Part>& a, const std::vector<Part>& b) {
    double sum = 0;
    for (size_t n = 0; n < a.size(); ++n) sum += a[n].dot(b[n]);
    return sum;
  }

  /// A block of a row of the matrix.
  struct Entry {
    uint32_t node, block;
    bool transposed;
  };

  const DeformationGraph& graph_;
  const std::vector<Eigen::Vector3f>& rest_;
  std::vector<uint32_t> first_;  ///< of each column, in rows_; and the end
  std::vector<uint32_t> rows_;   ///< of the blocks, ascending in each column
  std::array<Equations, kShares> shares_;
  std::vector<size_t> row_begin_;  ///< of each node in row_; and the end
  std::vector<Entry> row_;
  std::vector<Block> inverse_;  ///< of the diagonal
  std::vector<Part> change_, residual_, search_, product_;
};

GraphSolver::GraphSolver(const DeformationGraph& graph, const std::vector<Eigen::Vector3f>& rest)
    : impl_(std::make_unique<Impl>(graph, rest)) {}
GraphSolver::~GraphSolver() = default;

void GraphSolver::solve(std::span<const VertexTarget> targets, const GraphSolverOptions& options,
                        std::vector<NodeMotion>& motion) {
  impl_->solve(targets, options, motion);
}

}  // namespace v3d::recon
