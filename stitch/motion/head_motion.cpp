#include "stitch/motion/head_motion.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/geometry/head.h"

namespace nodal::motion {
namespace {

constexpr int kMinSide = 16, kMinLevelSide = 20;
constexpr int kLevels = 4;
constexpr int kPasses = 3;
constexpr float kHuber = 6;              // levels of 255; noise of small pictures is below it
constexpr double kMinShareInside = 0.5;  // part of the pixels that both pictures show
constexpr double kMinDetail = 1.0;       // levels per px, root mean square over the pixels and the worst axis
constexpr double kMaxUnlike = 0.5;       // part of the picture's variance that differs after the alignment

/// Half the size, each pixel the mean of four.
std::vector<float> halved(const std::vector<float>& image, int width, int height) {
  const int w = width / 2, h = height / 2;
  std::vector<float> half(static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      const float* const at = image.data() + static_cast<std::ptrdiff_t>(2 * y) * width + 2 * x;
      half[static_cast<std::size_t>(y * w + x)] = (at[0] + at[1] + at[width] + at[width + 1]) / 4;
    }
  }
  return half;
}

}  // namespace

Result<HeadMotion> HeadMotion::make(const HeadCalibration& calibration, int width, int height) {
  NODAL_TRY_ASSIGN(const geometry::Head head, geometry::Head::make(calibration));
  if (std::min(width, height) < kMinSide || width > head.width() || height > head.height()) {
    return fail(Errc::kBadValue, "pictures for the motion have 16 px or more, and not more than the head's");
  }
  HeadMotion motion;
  for (int w = width, h = height, n = 0; n < kLevels && std::min(w, h) >= kMinLevelSide; w /= 2, h /= 2, ++n) {
    Level level{w, h, {}, {}, {}};
    // A level's pixel covers 2^n small pixels, also where the small width is odd.
    const double scale_x = static_cast<double>(head.width()) / width * (1 << n);
    const double scale_y = static_cast<double>(head.height()) / height * (1 << n);
    for (int y = 1; y + 1 < h; ++y) {
      for (int x = 1; x + 1 < w; ++x) {
        const geometry::Pixel place{(x + 0.5) * scale_x, (y + 0.5) * scale_y};
        if (!head.contains(place)) continue;
        const auto ray = head.unproject(place);
        const auto seen = ray ? head.project_with_jacobian(*ray) : std::nullopt;
        if (!seen) continue;
        // A rotation w of the world moves the ray r by w x r = -[r]x w.
        const Eigen::Vector3d r = ray->direction();
        Eigen::Matrix3d cross;
        cross << 0, r.z(), -r.y(), -r.z(), 0, r.x(), r.y(), -r.x(), 0;
        Eigen::Matrix<double, 2, 3> moves = seen->J * cross;
        moves.row(0) /= scale_x;
        moves.row(1) /= scale_y;
        level.pixels.push_back({x, y, moves.cast<float>()});
      }
    }
    motion.levels_.push_back(std::move(level));
  }
  return motion;
}

/// Steps towards the rotation after which `now` looks like `before`.
void HeadMotion::improve(const Level& level, Motion& motion) {
  using Vector5 = Eigen::Matrix<float, 5, 1>;
  for (int pass = 0; pass < kPasses && motion.good; ++pass) {
    Eigen::Matrix<double, 5, 5> H = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> g = Eigen::Matrix<double, 5, 1>::Zero();
    const Eigen::Vector3f rotation = motion.rotation.cast<float>();
    const auto gain = static_cast<float>(motion.gain), offset = static_cast<float>(motion.offset);
    std::size_t inside = 0;
    double squares = 0, sum = 0, sum2 = 0;
    for (const Pixel& pixel : level.pixels) {
      const Eigen::Vector2f moved = pixel.moves * rotation;
      const float x = static_cast<float>(pixel.x) + moved.x(), y = static_cast<float>(pixel.y) + moved.y();
      if (!(x >= 0) || !(y >= 0) || x >= static_cast<float>(level.width - 1) ||
          y >= static_cast<float>(level.height - 1)) {
        continue;
      }
      const int ix = static_cast<int>(x), iy = static_cast<int>(y);
      const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
      const float* const at = level.now.data() + static_cast<std::ptrdiff_t>(iy) * level.width + ix;
      const float top = at[0] + fx * (at[1] - at[0]);
      const float low = at[level.width] + fx * (at[level.width + 1] - at[level.width]);
      const float* const old = level.before.data() + static_cast<std::ptrdiff_t>(pixel.y) * level.width + pixel.x;
      const float error = top + fy * (low - top) - gain * old[0] - offset;
      const Eigen::RowVector2f gradient((old[1] - old[-1]) / 2, (old[level.width] - old[-level.width]) / 2);
      Vector5 row;
      row << (gain * gradient * pixel.moves).transpose(), -old[0] / 128, -1;
      const float weight = std::abs(error) > kHuber ? kHuber / std::abs(error) : 1;
      H += (weight * row * row.transpose()).cast<double>();
      g += (weight * error * row).cast<double>();
      squares += error * error;
      sum += old[0];
      sum2 += old[0] * old[0];
      ++inside;
    }
    const auto count = static_cast<double>(inside);
    motion.good = count >= kMinShareInside * static_cast<double>(level.pixels.size()) && inside > 100;
    if (!motion.good) return;
    H.diagonal().array() += 1e-9 * H.trace() + 1e-12;
    const Eigen::Matrix<double, 5, 1> step = -H.ldlt().solve(g);
    motion.rotation += step.head<3>();
    motion.gain += step[3] / 128;
    motion.offset += step[4];
    // Detail that moves with a rotation about the axis that moves it least.
    const Eigen::Matrix3d R = H.topLeftCorner<3, 3>() - H.topRightCorner<3, 2>() *
                                                            H.bottomRightCorner<2, 2>().inverse() *
                                                            H.bottomLeftCorner<2, 3>();
    const double px_per_rad = level.width / 3.0;
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(R).eigenvalues()[0];
    motion.good = std::isfinite(step.squaredNorm()) && least > count * std::pow(kMinDetail * px_per_rad, 2) / 50;
    const double variance = motion.gain * motion.gain * (sum2 - sum * sum / count);
    motion.unlike = variance > 0 ? squares / variance : 1;
  }
}

std::optional<double> HeadMotion::add(std::span<const std::uint8_t> grey) {
  if (levels_.empty() ||
      grey.size() != static_cast<std::size_t>(levels_[0].width) * static_cast<std::size_t>(levels_[0].height)) {
    return std::nullopt;
  }
  for (std::size_t n = 0; n < levels_.size(); ++n) {
    Level& level = levels_[n];
    level.before.swap(level.now);
    if (n == 0) level.now.assign(grey.begin(), grey.end());
    else level.now = halved(levels_[n - 1].now, levels_[n - 1].width, levels_[n - 1].height);
  }
  if (!std::exchange(has_before_, true)) return std::nullopt;
  Motion motion;
  for (auto level = levels_.rbegin(); level != levels_.rend(); ++level) improve(*level, motion);
  if (!motion.good || motion.unlike > kMaxUnlike) return std::nullopt;
  return motion.rotation.norm();
}

}  // namespace nodal::motion
