#include "stitch/offline/head_picture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/geometry/ray.h"
#include "stitch/geometry/response.h"
#include "stitch/table/head_sight.h"

namespace nodal::offline {
namespace {

constexpr double kPi = std::numbers::pi;
/// Rays closer than this to a region's edge (px) count as outside, as in the table compiler.
constexpr double kEdge = 1e-6;
/// Keeps scores above 0 at a region's edge, where the head may be the only one.
constexpr double kMinDepth = 1e-9;
constexpr std::size_t kMaxLevels = 6;

table::TableOptions seam_options() {
  table::TableOptions options;
  options.transition = Transition::kSeam;
  return options;
}

/// Weights of the four samples around a position, `t` from the second one towards the third, by Mitchell and
/// Netravali's cubic ("Reconstruction Filters in Computer Graphics", 1988) with B = 0.2, C = 0.4. On synthetic_10head,
/// whose heads have noise, it is 0.3 dB better than Catmull and Rom's (B = 0), which keeps more of the noise; larger B
/// lose detail.
std::array<float, 4> head_weights(double t) {
  constexpr double B = 0.2, C = 0.4;
  const auto near = [](double x) {
    return ((12 - 9 * B - 6 * C) * x * x * x + (-18 + 12 * B + 6 * C) * x * x + 6 - 2 * B) / 6;
  };
  const auto far = [](double x) {
    return ((-B - 6 * C) * x * x * x + (6 * B + 30 * C) * x * x + (-12 * B - 48 * C) * x + 8 * B + 24 * C) / 6;
  };
  return {static_cast<float>(far(1 + t)), static_cast<float>(near(t)), static_cast<float>(near(1 - t)),
          static_cast<float>(far(2 - t))};
}

}  // namespace

Eigen::Vector3d ray_of(bands::Grid grid, double u, double v) {
  return geometry::Ray::at({(u / grid.width - 0.5) * 2 * kPi, (v / grid.height - 0.5) * kPi}).direction();
}

HeadView::HeadView(const geometry::Head& head, PixelFormat format, double power)
    : head_(head), optics_(table::HeadOptics::of(head, format, power, seam_options())) {
  for (std::size_t k = 0; k < values_.size(); ++k) {
    const double encoded = static_cast<double>(k) / 255;
    const double value =
        is_linear16(format) ? std::pow(geometry::decode(head.calibration().response, encoded), 1 / power) : encoded;
    values_[k] = static_cast<float>(255 * value);
  }
}

std::optional<Sighting> HeadView::see(const Eigen::Vector3d& rig_ray) const {
  const Eigen::Vector3d d = head_.seen_from_here(rig_ray);
  const double ahead = optics_.axis.dot(d);
  if (ahead < optics_.cos_reach) return std::nullopt;
  const auto seen =
      table::see(head_, optics_.lens, {optics_.right.dot(d), optics_.down.dot(d), ahead}, optics_.depth_per_px);
  if (!seen || seen->inside < kEdge || !std::isfinite(seen->density)) return std::nullopt;
  return Sighting{seen->pixel, seen->density, seen->density * (seen->depth + kMinDepth), seen->inside};
}

bands::Window HeadView::window(bands::Grid grid) const {
  // A cone about the axis; with a distance, the rig's ray and the head's differ by up to asin(offset).
  const double moved = std::asin(std::min(1.0, head_.offset().norm()));
  const double reach = std::min(kPi, std::acos(std::clamp(optics_.cos_reach, -1.0, 1.0)) + moved + 0.01);
  const geometry::Angles axis = head_.axis().angles();
  const auto row = [&](double phi) {
    return std::clamp(static_cast<int>(std::floor((phi / kPi + 0.5) * grid.height)), 0, grid.height - 1);
  };
  bands::Window window;
  window.y = row(axis.phi - reach);
  window.height = row(axis.phi + reach) + 1 - window.y;
  window.width = grid.width;
  if (std::abs(axis.phi) + reach >= kPi / 2) return window;
  const double turn = std::asin(std::min(1.0, std::sin(reach) / std::cos(axis.phi)));
  const auto begin = static_cast<int>(std::floor(((axis.theta - turn) / (2 * kPi) + 0.5) * grid.width));
  const auto end = static_cast<int>(std::ceil(((axis.theta + turn) / (2 * kPi) + 0.5) * grid.width));
  if (end - begin >= grid.width) return window;
  window.x = (begin + grid.width) % grid.width;
  window.width = end - begin;
  return window;
}

std::array<float, 3> HeadView::factors(geometry::Pixel pixel) const {
  const double undo = optics_.undo.undo(head_.vignetting(pixel));
  std::array<float, 3> factors{};
  for (std::size_t c = 0; c < 3; ++c) factors[c] = static_cast<float>(undo * optics_.gain[c]);
  return factors;
}

double HeadView::largest_factor() const {
  constexpr int kProbes = 32;
  const Region& region = head_.calibration().region;
  float largest = 0;
  for (int j = 0; j <= kProbes; ++j) {
    for (int i = 0; i <= kProbes; ++i) {
      const geometry::Pixel at{region.left + (region.right - region.left) * i / kProbes,
                               region.top + (region.bottom - region.top) * j / kProbes};
      if (head_.contains(at)) largest = std::max(largest, std::ranges::max(factors(at)));
    }
  }
  return static_cast<double>(largest);
}

HeadPicture::HeadPicture(const HeadView& view, const ImageView& picture)
    : view_(view), colours_(component_count(picture.format)) {
  levels_.push_back({picture.planes[0].data, picture.planes[0].row_stride, picture.width, picture.height});
  while (levels_.size() < kMaxLevels && std::min(levels_.back().width, levels_.back().height) >= 8) add_half();
}

void HeadPicture::add_half() {
  const Level& fine = levels_.back();
  Level half{nullptr, 0, fine.width / 2, fine.height / 2};
  half.stride = std::ptrdiff_t{half.width} * colours_;
  std::vector<std::uint8_t>& bytes = memory_.emplace_back(static_cast<std::size_t>(half.stride * half.height));
  for (int y = 0; y < half.height; ++y) {
    const std::uint8_t* upper = fine.data + 2 * y * fine.stride;
    const std::uint8_t* lower = upper + fine.stride;
    for (int x = 0; x < half.width; ++x) {
      for (int c = 0; c < colours_; ++c) {
        const std::ptrdiff_t i = std::ptrdiff_t{2} * x * colours_ + c;
        const int sum = upper[i] + upper[i + colours_] + lower[i] + lower[i + colours_];
        bytes[static_cast<std::size_t>(y * half.stride + std::ptrdiff_t{x} * colours_ + c)] =
            static_cast<std::uint8_t>((sum + 2) / 4);
      }
    }
  }
  half.data = bytes.data();
  levels_.push_back(half);
}

void HeadPicture::sample(const Sighting& at, double radians_per_pixel, float* into) const {
  const double ratio = std::sqrt(at.density) * radians_per_pixel;  // pixels of the picture per pixel of the result
  const int wanted = static_cast<int>(std::floor(std::log2(std::max(1.0, ratio))));
  const auto l = static_cast<std::size_t>(std::min(wanted, static_cast<int>(levels_.size()) - 1));
  const Level& level = levels_[l];
  const double scale = std::ldexp(1.0, -static_cast<int>(l));
  const double u = at.pixel.x * scale - 0.5, v = at.pixel.y * scale - 0.5;
  const int column = static_cast<int>(std::floor(u)), row = static_cast<int>(std::floor(v));
  const std::array<float, 4> across = head_weights(u - column), down = head_weights(v - row);
  float sums[3] = {0, 0, 0};
  for (int j = 0; j < 4; ++j) {
    const std::uint8_t* line = level.data + std::clamp(row - 1 + j, 0, level.height - 1) * level.stride;
    for (int i = 0; i < 4; ++i) {
      const std::uint8_t* pixel = line + std::clamp(column - 1 + i, 0, level.width - 1) * colours_;
      const float weight = across[static_cast<std::size_t>(i)] * down[static_cast<std::size_t>(j)];
      for (int c = 0; c < colours_; ++c) sums[c] += weight * view_.value(pixel[c]);
    }
  }
  const std::array<float, 3> factors = view_.factors(at.pixel);
  for (int c = 0; c < colours_; ++c) into[c] = sums[c] * factors[static_cast<std::size_t>(c)];
}

bands::Layer HeadPicture::on(bands::Grid grid, const bands::Window& window, const parallel::Workers& workers) const {
  return on(grid, window, workers, [&](double u, double v) { return view_.see(ray_of(grid, u, v)); });
}

bands::Layer HeadPicture::on(bands::Grid grid, const bands::Window& window, const parallel::Workers& workers,
                             const See& see) const {
  bands::Layer layer(grid, window, colours_ + 1);
  const double radians_per_pixel = kPi / grid.height;
  workers.run(window.height, [&](int j) {
    for (int i = 0; i < window.width; ++i) {
      const std::optional<Sighting> seen = see((window.x + i) % grid.width + 0.5, window.y + j + 0.5);
      if (!seen) continue;
      float* pixel = layer.at(i, j);
      sample(*seen, radians_per_pixel, pixel);
      pixel[colours_] = static_cast<float>(seen->score);
    }
  });
  return layer;
}

}  // namespace nodal::offline
