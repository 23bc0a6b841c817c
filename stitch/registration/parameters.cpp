#include "stitch/registration/parameters.h"

#include <algorithm>
#include <cmath>

namespace nodal::registration {
namespace {

// Soft priors of lenses: of focal lengths and the pixels' aspect, relative; of centres and radial terms, relative to
// the radius of the edge.
constexpr double kLensSigma = 0.005;

// Collects the columns of B: each is a list of (row, factor).
class Basis {
 public:
  explicit Basis(int rows) : rows_(rows) {}
  int add() { return columns_++; }
  void set(int row, int column, double factor) { entries_.push_back({row, column, factor}); }
  void own(int row) { set(row, add(), 1); }
  Eigen::MatrixXd matrix() const {
    Eigen::MatrixXd B = Eigen::MatrixXd::Zero(rows_, columns_);
    for (const Entry& entry : entries_) B(entry.row, entry.column) += entry.factor;
    return B;
  }

 private:
  struct Entry {
    int row, column;
    double factor;
  };
  int rows_, columns_ = 0;
  std::vector<Entry> entries_;
};

// Keeps the sum zero: each free parameter changes the last one by the opposite.
void add_zero_sum(Basis& basis, const std::vector<int>& rows) {
  for (std::size_t k = 0; k + 1 < rows.size(); ++k) {
    const int column = basis.add();
    basis.set(rows[k], column, 1);
    basis.set(rows.back(), column, -1);
  }
}

void add_shared(Basis& basis, const std::vector<int>& rows) {
  if (rows.empty()) return;
  const int column = basis.add();
  for (const int row : rows) basis.set(row, column, 1);
}

// Those in `own` have a column each, and the rest of `all` follows their mean; without any, one column moves all.
void add_vignetting(Basis& basis, const std::vector<int>& all, const std::vector<int>& own) {
  if (own.empty()) return add_shared(basis, all);
  for (const int row : own) {
    const int column = basis.add();
    for (const int each : all) {
      if (each == row) basis.set(each, column, 1);
      else if (std::ranges::find(own, each) == own.end())
        basis.set(each, column, 1.0 / static_cast<double>(own.size()));
    }
  }
}

}  // namespace

Parameters::Parameters(const std::vector<HeadState>& heads, const Sought& sought, const Held& held) {
  for (const HeadState& head : heads) {
    slots_.push_back(slots_of(sought, radial_count(head.lens)));
    stride_ = std::max(stride_, slots_.back().count);
  }
  const int n = static_cast<int>(heads.size());
  Basis basis(n * stride_);
  const auto rows = [&](auto slot_of, int offset, const std::vector<bool>& stays) {
    std::vector<int> all;
    for (int h = 0; h < n; ++h) {
      const auto i = static_cast<std::size_t>(h);
      if (stays[i]) continue;
      if (const int slot = slot_of(slots_[i]); slot >= 0) all.push_back(h * stride_ + slot + offset);
    }
    return all;
  };
  const auto focal = [](const Slots& slots) { return slots.focal; };
  const auto radial = [](const Slots& slots) { return slots.radial; };
  const auto aspect = [](const Slots& slots) { return slots.aspect; };
  const auto nearness = [](const Slots& slots) { return slots.nearness; };
  const auto gain = [](const Slots& slots) { return slots.gain; };
  const auto vignetting = [](const Slots& slots) { return slots.vignetting; };
  for (int h = 0; h < n; ++h) {
    const auto i = static_cast<std::size_t>(h);
    const Slots& slots = slots_[i];
    for (int k = 0; k < 3 && slots.rotation >= 0 && h != held.first && !held.geometry[i]; ++k) {
      basis.own(h * stride_ + slots.rotation + k);
    }
    for (int k = 0; k < 2 && slots.center >= 0 && !held.geometry[i]; ++k) basis.own(h * stride_ + slots.center + k);
    if (held.share_lens || held.geometry[i]) continue;
    if (slots.focal >= 0) basis.own(h * stride_ + slots.focal);
    for (int k = 0; k < slots.radials; ++k) basis.own(h * stride_ + slots.radial + k);
  }
  if (held.share_lens) {
    add_shared(basis, rows(focal, 0, held.geometry));
    for (int k = 0; k < slots_.front().radials; ++k) add_shared(basis, rows(radial, k, held.geometry));
  }
  add_shared(basis, rows(aspect, 0, held.geometry));
  add_shared(basis, rows(nearness, 0, std::vector<bool>(heads.size(), false)));
  for (int c = 0; c < slots_.front().gains; ++c) {
    const std::vector<int> all = rows(gain, c, held.light);
    if (held.free_gains) {
      for (const int row : all) basis.own(row);
    } else {
      add_zero_sum(basis, all);
    }
  }
  std::vector<bool> others = held.light;  // heads without a fall-off of their own
  for (std::size_t h = 0; h < heads.size(); ++h) {
    others[h] = others[h] || held.own_vignetting.empty() || !held.own_vignetting[h];
  }
  for (int k = 0; k < kVignettingTerms; ++k) {
    add_vignetting(basis, rows(vignetting, k, held.light), rows(vignetting, k, others));
  }
  basis_ = basis.matrix();
  sparse_ = basis_.sparseView();
}

std::vector<bool> Parameters::part_of(const Sought& sought) const {
  std::vector<bool> part(static_cast<std::size_t>(basis_.cols()), true);
  for (std::size_t h = 0; h < slots_.size(); ++h) {
    const Slots& slots = slots_[h];
    const auto leave_out = [&](int first, int count) {
      for (int k = 0; k < count && first >= 0; ++k) {
        const auto row = basis_.row(static_cast<Eigen::Index>(h) * stride_ + first + k);
        for (Eigen::Index column = 0; column < row.size(); ++column) {
          if (row[column] != 0) part[static_cast<std::size_t>(column)] = false;
        }
      }
    };
    if (!sought.focal && !sought.lens) leave_out(slots.focal, 1);
    if (!sought.lens) {
      leave_out(slots.center, 2);
      leave_out(slots.radial, slots.radials);
    }
    if (!sought.aspect) leave_out(slots.aspect, 1);
    if (!sought.nearness) leave_out(slots.nearness, 1);
  }
  return part;
}

Eigen::MatrixXd Parameters::lens_weights(const std::vector<HeadState>& heads) const {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(basis_.rows());
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const Eigen::Index row = static_cast<Eigen::Index>(h) * stride_;
    const double px = 1 / std::pow(kLensSigma * heads[h].edge_radius, 2);
    if (slots_[h].aspect >= 0) weights[row + slots_[h].aspect] = 1 / (kLensSigma * kLensSigma);
    if (slots_[h].focal >= 0) weights[row + slots_[h].focal] = 1 / (kLensSigma * kLensSigma);
    if (slots_[h].center >= 0) weights.segment<2>(row + slots_[h].center).setConstant(px);
    if (slots_[h].radial >= 0) weights.segment(row + slots_[h].radial, slots_[h].radials).setConstant(px);
  }
  return sparse_.transpose() * weights.asDiagonal() * sparse_;
}

Eigen::VectorXd Parameters::gradient(const Normal& normal) const {
  return sparse_.transpose() * Eigen::Map<const Eigen::VectorXd>(normal.gradient.data(), basis_.rows());
}

Eigen::MatrixXd Parameters::hessian(const Normal& normal, Curvature curvature) const {
  Eigen::MatrixXd all(basis_.rows(), basis_.rows());
  for (int a = 0; a < normal.heads; ++a) {
    for (int b = 0; b < normal.heads; ++b) {
      all.block(a * stride_, b * stride_, stride_, stride_) = normal.hessian(a, b, curvature);
    }
  }
  const Eigen::MatrixXd left = sparse_.transpose() * all;
  return left * sparse_;
}

std::vector<HeadState> Parameters::moved(const std::vector<HeadState>& heads, const Eigen::VectorXd& free_step) const {
  const Eigen::VectorXd all = sparse_ * free_step;
  std::vector<HeadState> next;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    next.push_back(
        registration::moved(heads[h], slots_[h], all.segment(static_cast<Eigen::Index>(h) * stride_, slots_[h].count)));
  }
  return next;
}

double Parameters::largest_turn(const Eigen::VectorXd& free_step) const {
  const Eigen::VectorXd all = sparse_ * free_step;
  double largest = 0;
  for (std::size_t h = 0; h < slots_.size(); ++h) {
    if (slots_[h].rotation < 0) continue;
    const auto row = static_cast<Eigen::Index>(h) * stride_ + slots_[h].rotation;
    largest = std::max(largest, all.segment<3>(row).norm());
  }
  return largest;
}

}  // namespace nodal::registration
