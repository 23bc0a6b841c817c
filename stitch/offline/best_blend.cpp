#include "stitch/offline/best_blend.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/bands/multi_band.h"
#include "stitch/bands/pyramid.h"
#include "stitch/offline/parallax.h"
#include "stitch/offline/sight_grid.h"
#include "stitch/parallel/workers.h"
#include "stitch/table/tone_compiler.h"

namespace nodal::offline {
namespace {

using bands::Grid;
using bands::Layer;
using bands::Window;

/// Of the sphere that other layouts are sampled from, relative to their own resolution: sampling twice blurs less.
constexpr double kFiner = 1.5;
/// Of the charts on which flow is computed, on a whole circle: 0.7 degrees each, and less for a part of the sphere.
constexpr int kFlowColumns = 512;
/// A head is projected this far beyond the area that it shows: coarser bands reach there.
constexpr double kMarginDeg = 15;

/// The columns and rows of the pixels that `owner` has, with the margin, inside `outer`. Nothing if it has none.
/// `owners`: of the pixels of `seen`, which holds `outer`.
std::optional<Window> window_of(const std::vector<std::uint8_t>& owners, Grid grid, const Window& seen,
                                std::size_t owner, const Window& outer) {
  int top = outer.height, bottom = -1, left = outer.width, right = -1;
  for (int j = 0; j < outer.height; ++j) {
    const std::uint8_t* row = owners.data() + static_cast<std::ptrdiff_t>(outer.y - seen.y + j) * seen.width;
    for (int i = 0; i < outer.width; ++i) {
      if (row[(outer.x - seen.x + i + grid.width) % grid.width] != owner) continue;
      top = std::min(top, j);
      bottom = std::max(bottom, j);
      left = std::min(left, i);
      right = std::max(right, i);
    }
  }
  if (bottom < 0) return std::nullopt;
  const int margin = static_cast<int>(std::ceil(kMarginDeg / 180 * grid.height));
  Window window = outer;
  const int first = std::max(0, top - margin), last = std::min(outer.height - 1, bottom + margin);
  window.y = outer.y + first;
  window.height = last - first + 1;
  // Columns are narrower by the cosine of the latitude.
  const auto cosine = [&](int y) { return std::sin((y + 0.5) / grid.height * std::numbers::pi); };
  const double narrowest = std::min(cosine(window.y), cosine(window.y + window.height - 1));
  const int beside = static_cast<int>(std::min<double>(grid.width, margin / narrowest));
  const int begin = std::max(0, left - beside), end = std::min(outer.width, right + 1 + beside);
  window.x = (outer.x + begin) % grid.width;
  window.width = end - begin;
  return window;
}

bool is_window_of(Grid grid, const Window& window) {
  return window.x >= 0 && window.x < grid.width && window.width > 0 && window.width <= grid.width && window.y >= 0 &&
         window.height > 0 && window.y + window.height <= grid.height;
}

/// The rows of `window`, if `seen` is a part of the sphere: then all columns of that.
Window rows_within(const Window& seen, const Window& window, Grid grid) {
  if (seen.width == grid.width && seen.height == grid.height) return window;
  const int top = std::max(seen.y, window.y);
  const int bottom = std::min(seen.y + seen.height, window.y + window.height);
  return {seen.x, top, seen.width, std::max(0, bottom - top)};
}

std::uint8_t rounded(float value) { return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0F, 255.0F))); }

}  // namespace

Result<BestBlend> BestBlend::make(const Calibration& calibration, const table::RaymapSpec& raymap, int threads,
                                  std::optional<Window> seen) {
  if (in_8_bits(raymap.format) != PixelFormat::kRgb24 && in_8_bits(raymap.format) != PixelFormat::kGrey8) {
    return fail(Errc::kUnsupported, "a raymap of " + std::string(pixel_format_name(raymap.format)) +
                                        " cannot be blended at best quality; ask for RGB24, GREY, RGB48 or GREY16");
  }
  NODAL_TRY_ASSIGN(const auto name, geometry::LayoutName::parse(raymap.layout));
  NODAL_TRY_ASSIGN(auto layout, geometry::make_layout(name, raymap.width, raymap.height));
  NODAL_TRY_ASSIGN(const auto heads, geometry::make_heads(calibration));
  BestBlend made;
  made.format_ = raymap.format;
  made.layout_ = std::move(layout);
  made.equirectangular_ = name.is_equirectangular();
  made.sphere_ = {raymap.width, raymap.height};
  if (!made.equirectangular_) {
    const double wide = kFiner * 2 * std::numbers::pi * raymap.width / name.kind().radians_across;
    const int height = std::max(8, static_cast<int>(std::ceil(std::min(wide, 1e6) / 2)));
    made.sphere_ = {2 * height, height};
  }
  made.seen_ = seen && made.equirectangular_ ? *seen : Window::all(made.sphere_);
  NODAL_ASSERT(is_window_of(made.sphere_, made.seen_));
  if (std::int64_t{made.seen_.width} * made.seen_.height > kMaxPixels) {
    return fail(Errc::kTooLarge,
                fmt::format("a sphere of {} x {} pixels takes too much memory at best quality; ask for a smaller width",
                            made.seen_.width, made.seen_.height));
  }
  // A part of the sphere has pixels that are finer, and seams must go around things that are smaller.
  made.finer_ = made.seen_.width <= made.sphere_.width / 4 ? 4 : made.seen_.width <= made.sphere_.width / 2 ? 2 : 1;
  made.map_ = {std::min(made.finer_ * kMapWidth, std::max(32, made.sphere_.width / 2)), 0};
  made.map_.height = made.map_.width / 2;
  made.power_ = table::linear_power(calibration);
  made.threads_ = threads;
  double largest = 0;
  for (const geometry::Head& head : heads) {
    made.heads_.emplace_back(head, raymap.format, made.power_);
    made.windows_.push_back(rows_within(made.seen_, made.heads_.back().window(made.sphere_), made.sphere_));
    largest = std::max(largest, made.heads_.back().largest_factor());
  }
  made.full_ = 255 * largest;
  return made;
}

Status BestBlend::check_pictures(std::span<const ImageView> pictures) const {
  if (pictures.size() != heads_.size()) {
    return fail(Errc::kHeadMismatch,
                fmt::format("{} pictures for {} heads; give one a head", pictures.size(), heads_.size()));
  }
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    const ImageView& picture = pictures[h];
    if (picture.planes[0].data == nullptr) continue;
    if (picture.format == in_8_bits(format_) && picture.width == heads_[h].head().width() &&
        picture.height == heads_[h].head().height())
      continue;
    return fail(Errc::kHeadMismatch,
                fmt::format("head {}: the picture has {}x{} pixels ({}), and {}x{} ({}) are needed", h, picture.width,
                            picture.height, pixel_format_name(picture.format), heads_[h].head().width(),
                            heads_[h].head().height(), pixel_format_name(in_8_bits(format_))));
  }
  return {};
}

Result<DecodedImage> BestBlend::blend(std::span<const ImageView> pictures, std::vector<SeamCheck>* checks,
                                      const std::function<void(double)>& progress) {
  NODAL_TRY(check_pictures(pictures));
  const auto tell = [&](double done) {
    if (progress) progress(done);
  };
  const parallel::Workers workers(threads_);
  const int colours = component_count(format_);
  const Parallax parallax(heads_, pictures, finer_ * kFlowColumns, workers);
  tell(0.15);
  const MovedRay moved = [&](std::size_t h, const Eigen::Vector3d& ray) { return parallax.moved(h, ray); };
  const auto has_picture = [&](std::size_t h) { return pictures[h].planes[0].data != nullptr; };
  std::vector<SightGrid> sights;
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    sights.emplace_back(
        heads_[h], [&, h](const Eigen::Vector3d& ray) { return moved(h, ray); }, sphere_,
        has_picture(h) ? windows_[h] : Window{}, finer_ * kFlowColumns, workers);
  }
  tell(0.25);
  {
    const double across = static_cast<double>(sphere_.width) / map_.width;
    const double down = static_cast<double>(sphere_.height) / map_.height;
    std::vector<Layer> views;
    for (std::size_t h = 0; h < heads_.size(); ++h) {
      if (!has_picture(h)) views.emplace_back(map_, Window{}, colours + 1);
      else
        views.push_back(
            HeadPicture(heads_[h], pictures[h]).on(map_, heads_[h].window(map_), workers, [&](double u, double v) {
              return sights[h].near(u * across, v * down);
            }));
    }
    labels_ = seams::place_seams(views, labels_);
  }
  tell(0.3);
  if (checks != nullptr) *checks = check_seams(heads_, pictures, moved, {labels_, map_}, sphere_, workers);
  tell(0.35);
  const std::vector<std::uint8_t> owner_of = owners(sights);
  bands::MultiBand bands(sphere_, seen_, colours, threads_);
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    const std::optional<Window> window = window_of(owner_of, sphere_, seen_, h, windows_[h]);
    if (!window) continue;
    Layer shown(sphere_, *window, colours + 2);
    const HeadPicture picture(heads_[h], pictures[h]);
    workers.run(window->height, [&](int j) {
      const std::uint8_t* owners = owner_of.data() + static_cast<std::ptrdiff_t>(window->y + j - seen_.y) * seen_.width;
      for (int i = 0; i < window->width; ++i) {
        const int x = (window->x + i) % sphere_.width;
        const auto seen = sights[h].at(x, window->y + j);
        if (!seen) continue;
        float* pixel = shown.at(i, j);
        picture.sample(*seen, std::numbers::pi / sphere_.height, pixel);
        pixel[colours] = 1;
        pixel[colours + 1] = owners[(x - seen_.x + sphere_.width) % sphere_.width] == h;
      }
    });
    bands.add(std::move(shown));
    tell(0.4 + 0.6 * static_cast<double>(h + 1) / static_cast<double>(heads_.size()));
  }
  return in_layout(bands.finish());
}

std::vector<std::uint8_t> BestBlend::owners(std::span<const SightGrid> sights) const {
  std::vector<std::uint8_t> owners(static_cast<std::size_t>(seen_.width) * static_cast<std::size_t>(seen_.height),
                                   seams::kNobody);
  parallel::Workers(threads_).run(seen_.height, [&](int j) {
    choose_owners_of_row(seen_.y + j, sights, owners.data() + static_cast<std::ptrdiff_t>(j) * seen_.width);
  });
  return owners;
}

void BestBlend::choose_owners_of_row(int y, std::span<const SightGrid> sights, std::uint8_t* owners) const {
  std::vector<seams::Share> shares;
  for (int i = 0; i < seen_.width; ++i) {
    const int x = (seen_.x + i) % sphere_.width;
    seams::shares_at(labels_, map_, (x + 0.5) * map_.width / sphere_.width, (y + 0.5) * map_.height / sphere_.height,
                     shares);
    for (const seams::Share& share : shares) {
      if (!sights[share.head].at(x, y)) continue;
      owners[i] = share.head;
      break;
    }
    if (owners[i] != seams::kNobody) continue;
    double best = 0;
    for (std::size_t h = 0; h < heads_.size(); ++h) {
      const auto seen = sights[h].at(x, y);
      if (!seen || seen->score <= best) continue;
      best = seen->score;
      owners[i] = static_cast<std::uint8_t>(h);
    }
  }
}

DecodedImage BestBlend::in_layout(const Layer& sphere) const {
  const int width = equirectangular_ ? seen_.width : layout_->width(), colours = component_count(format_);
  const int height = equirectangular_ ? seen_.height : layout_->height();
  const bool linear = is_linear16(format_);
  DecodedImage raymap{format_, width, height, {}};
  if (is_linear16(format_)) raymap.meaning = SampleMeaning::linear();
  raymap.bytes.resize(packed_size(format_, width, height));
  parallel::Workers(threads_).run(height, [&](int y) {
    std::array<float, 4> pixel{};
    for (int x = 0; x < width; ++x) {
      if (equirectangular_) {
        std::copy_n(sphere.at(x, y), colours + 1, pixel.begin());
      } else {
        const auto ray = layout_->ray(x + 0.5, y + 0.5);
        if (!ray) continue;
        const geometry::Angles angles = ray->angles();
        bands::sample_cubic(sphere, (angles.theta / (2 * std::numbers::pi) + 0.5) * sphere_.width,
                            (angles.phi / std::numbers::pi + 0.5) * sphere_.height, pixel.data());
      }
      if (!(pixel[static_cast<std::size_t>(colours)] > 0)) continue;
      const std::size_t at =
          (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) *
          static_cast<std::size_t>(colours);
      for (std::size_t c = 0; c < static_cast<std::size_t>(colours); ++c) {
        if (!linear) {
          raymap.bytes[at + c] = rounded(pixel[c]);
          continue;
        }
        const double light = std::pow(std::clamp(static_cast<double>(pixel[c]) / full_, 0.0, 1.0), power_);
        const auto number = static_cast<std::uint16_t>(std::lround(65535 * light));
        raymap.bytes[2 * (at + c)] = static_cast<std::uint8_t>(number & 0xff);
        raymap.bytes[2 * (at + c) + 1] = static_cast<std::uint8_t>(number >> 8);
      }
    }
  });
  return raymap;
}

}  // namespace nodal::offline
