#include "stitch/autocalibration/autocalibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/autocalibration/arrangement.h"
#include "stitch/autocalibration/image_circle.h"
#include "stitch/autocalibration/in_common.h"
#include "stitch/autocalibration/matches.h"
#include "stitch/autocalibration/misfit.h"
#include "stitch/autocalibration/overlap.h"
#include "stitch/autocalibration/sight.h"
#include "stitch/autocalibration/upright.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/geometry/turned_rig.h"
#include "stitch/parallel/part_of.h"
#include "stitch/parallel/workers.h"

namespace nodal::autocalibration {
namespace {

constexpr double kMinCorrelation = 0.3;  // lowest correlation of two pictures' detail where they overlap
// Points of two pictures that must agree to show that they see the same things.
constexpr std::ptrdiff_t kSameThings = 16;
constexpr double kSamePlace = 2;  // px between a point's images in two pictures that count as the same place
constexpr double kWithin = 0.98;  // share of the lens's largest radius that a region may reach

Region scaled(const Region::Circle* circle, int width, int height, double scale) {
  Region region{0, 0, width * scale, height * scale, {}};
  if (circle != nullptr) region.circle = Region::Circle{circle->x * scale, circle->y * scale, circle->radius * scale};
  return region;
}

/// The circles of all pictures if most have one; a picture without a visible edge gets the middle of the others.
std::vector<Shape> shapes_of(const std::vector<DecodedImage>& pictures, const std::vector<Picture>& small) {
  std::vector<Shape> shapes;
  std::vector<double> radii, xs, ys;
  for (std::size_t h = 0; h < pictures.size(); ++h) {
    Shape shape{pictures[h].width, pictures[h].height, {}};
    if (const auto circle = find_image_circle(small[h])) {
      const double scale = static_cast<double>(pictures[h].width) / small[h].width;
      shape.circle = Region::Circle{circle->x * scale, circle->y * scale, circle->radius * scale};
      radii.push_back(shape.circle->radius / shape.width);
      xs.push_back(shape.circle->x / shape.width);
      ys.push_back(shape.circle->y / shape.height);
    }
    shapes.push_back(shape);
  }
  const bool fisheyes = 2 * radii.size() > pictures.size();
  const auto middle = [](std::vector<double>& values) {
    const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, half);
    return *half;
  };
  for (Shape& shape : shapes) {
    if (!fisheyes) {
      shape.circle.reset();
    } else if (!shape.circle) {
      shape.circle = Region::Circle{middle(xs) * shape.width, middle(ys) * shape.height, middle(radii) * shape.width};
    }
  }
  return shapes;
}

/// Removes from the region what is beyond the rising part of the lens.
void limit_to_lens(HeadCalibration& head) {
  const Result<geometry::Lens> lens = geometry::Lens::make(head.lens);
  if (!lens) return;
  const double most = kWithin * lens->max_radius();
  if (head.region.circle) {
    const double off = std::hypot(head.region.circle->x - head.center_x, head.region.circle->y - head.center_y);
    head.region.circle->radius = std::min(head.region.circle->radius, most - off);
    return;
  }
  const double corner = std::hypot(std::max(head.center_x, head.width - head.center_x),
                                   std::max(head.center_y, head.height - head.center_y) / std::min(1.0, head.aspect));
  if (corner > most)
    head.region.circle = Region::Circle{head.center_x, head.center_y, most * std::min(1.0, head.aspect)};
}

/// Refuses two pictures that show the same things at the same places, because they do not determine a lens.
Status check_different(const std::vector<Match>& used, std::size_t pictures, const std::vector<std::string>& names) {
  for (std::size_t a = 0; a < pictures; ++a) {
    for (std::size_t b = a + 1; b < pictures; ++b) {
      std::size_t all = 0, same = 0;
      for (const Match& match : used) {
        if (match.a != a || match.b != b) continue;
        ++all;
        same += std::hypot(match.pixel_a.x - match.pixel_b.x, match.pixel_a.y - match.pixel_b.y) < kSamePlace ? 1 : 0;
      }
      if (all == 0 || 2 * same < all) continue;
      return fail(Errc::kHeadMismatch,
                  fmt::format("'{}' and '{}' are the same picture, or taken in the same direction; leave one out",
                              names[a], names[b]));
    }
  }
  return {};
}

HeadCalibration head_of(const Shape& shape, const SharedLens& lens, const Eigen::Matrix3d& R_head_rig,
                        const std::string& name) {
  HeadCalibration head;
  head.name = name;
  head.width = shape.width;
  head.height = shape.height;
  head.center_x = shape.center().x + lens.shift.x() * shape.unit();
  head.center_y = shape.center().y + lens.shift.y() * shape.unit();
  head.aspect = lens.aspect;
  KannalaBrandtLens model = lens.model;
  model.focal *= shape.unit();
  head.lens = model;
  head.R_head_rig = geometry::rows_of(R_head_rig);
  head.region = scaled(shape.circle ? &*shape.circle : nullptr, shape.width, shape.height, 1);
  head.region.masks = shape.masks;
  head.vignetting = {head.center_x, head.center_y, shape.unit(), {}};
  head.response.curve = Response::Curve::kSrgb;
  limit_to_lens(head);
  return head;
}

/// Turns the whole rig upright.
Status turn_upright(const std::vector<Picture>& small, const std::vector<Eigen::Vector2d>& up, Found& found) {
  NODAL_TRY_ASSIGN(std::vector<geometry::Head> heads, geometry::make_heads(found.calibration));
  std::vector<Picture> pictures;
  std::vector<Eigen::Vector2d> held;
  for (const std::size_t h : found.placed) {
    pictures.push_back(small[h]);
    held.push_back(h < up.size() ? up[h] : Eigen::Vector2d(0, -1));
  }
  const Upright upright = find_upright(heads, pictures, held);
  found.up = upright.basis;
  const Eigen::Matrix3d R_new_rig = upright_rotation(upright.up, heads.front().axis().direction());
  found.calibration = geometry::turned_rig(std::move(found.calibration), R_new_rig);
  return {};
}

/// Lens and rotations from what the pictures show.
Result<Arrangement> arranged(const std::vector<Shape>& shapes, const Sight& sight, const Overlaps& overlaps,
                             int threads, Overlap overlap, const std::function<void(double)>& progress) {
  const InCommon common(shapes, sight.features, sight.matches);
  const auto matched = [&](std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens& lens) {
    return common.agreeing(a, b, R_b_a, lens);
  };
  const auto alike = [&](std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens& lens) {
    if (common.agreeing(a, b, R_b_a, lens) == 0) return 0.0;
    const double correlation = overlaps.correlation(a, b, R_b_a, lens, lens);
    return correlation > kMinCorrelation ? correlation : 0;
  };
  return find_arrangement(shapes, sight.matches, threads, {matched, alike}, overlap, progress);
}

/// The error of pictures that are not placed: the cause, and what helps.
Error with_advice(Error error, const Repetition& repetition, bool fisheyes) {
  if (repetition.prevails()) {
    error.message = fmt::format(
        "most of what the pictures show repeats: {} of {} points look the same as two or more of another picture, as "
        "windows or tiles do, so that nothing tells which of them belong together",
        repetition.ambiguous, repetition.features);
  }
  error.message += ": give pictures that overlap more, taken at the same place";
  if (fisheyes) error.message += ", or the field of view of their lens, for example --nominal 2x200";
  return error;
}

/// The error of pictures that would fit if one of them were mirrored or had another focal length.
Error not_fitting(const Misfit& misfit, const std::vector<std::string>& files) {
  const std::string& a = files[misfit.other];
  const std::string& b = files[misfit.picture];
  if (misfit.cause == Misfit::Cause::kMirrored) {
    return {
        Errc::kHeadMismatch,
        fmt::format("{} and {} fit together only if one of them is mirrored; flip the one that is the wrong way round "
                    "(convert FILE -flop FLIPPED)",
                    a, b)};
  }
  return {
      Errc::kHeadMismatch,
      fmt::format("{} and {} show the same things at different scales: the focal length of {} is about {:.2g} times "
                  "the other one's, so that one of them was cropped or taken with another zoom; give whole "
                  "pictures of one zoom",
                  a, b, misfit.focal_ratio > 1 ? b : a, std::max(misfit.focal_ratio, 1 / misfit.focal_ratio))};
}

void add_points(const Arrangement& arrangement, Found& found) {
  std::vector<std::size_t> place(arrangement.R_head_rig.size(), found.placed.size());
  for (std::size_t n = 0; n < found.placed.size(); ++n) place[found.placed[n]] = n;
  for (Match match : arrangement.used) {
    match.a = place[match.a];
    match.b = place[match.b];
    if (std::max(match.a, match.b) < found.placed.size()) found.points.push_back(match);
  }
}

/// Near things, or a lens that is some percent off, displace pictures of the same things so far that their detail does
/// not correlate. Points that agree nevertheless prove that they are the same things.
void add_doubtful(const Arrangement& arrangement, const Overlaps& overlaps, Found& found) {
  for (std::size_t i = 0; i < found.placed.size(); ++i) {
    for (std::size_t j = i + 1; j < found.placed.size(); ++j) {
      const auto agreeing = std::ranges::count_if(found.points, [&](const Match& m) { return m.a == i && m.b == j; });
      if (agreeing >= kSameThings) continue;
      const std::size_t a = found.placed[i], b = found.placed[j];
      const Eigen::Matrix3d R_b_a = *arrangement.R_head_rig[b] * arrangement.R_head_rig[a]->transpose();
      if (overlaps.correlation(a, b, R_b_a, arrangement.lens_of(a), arrangement.lens_of(b)) <= kMinCorrelation)
        found.doubtful.emplace_back(i, j);
    }
  }
}

}  // namespace

Result<Found> autocalibrate(const std::vector<DecodedImage>& pictures, const std::vector<std::string>& names,
                            const Options& options) {
  const std::size_t count = pictures.size();
  if (count < 2) return fail(Errc::kBadValue, "this is one picture only; give two or more that overlap");
  if (count > kMaxPictures) {
    return fail(Errc::kBadValue,
                fmt::format("{} pictures; without a calibration at most {} are matched", count, kMaxPictures));
  }
  const auto tell = [&](double done) {
    if (options.progress) options.progress(done);
  };
  const parallel::Workers workers(options.threads);
  std::vector<Picture> small(count);
  workers.run(static_cast<int>(count), [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    small[n] = reduced(pictures[n], kEdgeSide);
  });
  std::vector<Shape> shapes = shapes_of(pictures, small);
  for (std::size_t n = 0; n < std::min(count, options.focal_px.size()); ++n) shapes[n].focal_px = options.focal_px[n];
  for (std::size_t n = 0; n < std::min(count, options.masks.size()); ++n) shapes[n].masks = options.masks[n];
  tell(0.05);
  Sight sight = see(pictures, shapes, workers, parallel::part_of(options.progress, 0.05, 0.65));
  tell(0.7);
  const Overlaps overlaps(shapes, small);
  const Repetition repetition = sight.repetition;
  Result<Arrangement> arrangement =
      arranged(shapes, sight, overlaps, options.threads, Overlap::kWide, parallel::part_of(options.progress, 0.7, 0.2));
  const bool fisheyes = shapes.front().circle.has_value();  // if one has a circle, all have
  if (!arrangement && fisheyes && !repetition.prevails()) {
    // Overlaps may be so thin that hardly any of these features are in them.
    sight = see_rims(pictures, shapes, workers, parallel::part_of(options.progress, 0.9, 0.05));
    arrangement = arranged(shapes, sight, overlaps, options.threads, Overlap::kThin,
                           parallel::part_of(options.progress, 0.95, 0.04));
  }
  const std::vector<std::string>& files = options.files.empty() ? names : options.files;
  const MisfitSearch search{pictures, shapes, small, sight, workers};
  if (!arrangement) {
    // What repeats, such as tiles, also fits its mirror image, and itself at another scale.
    const std::optional<Misfit> misfit = repetition.prevails() ? std::nullopt : first_misfit(search);
    if (misfit) return fail(not_fitting(*misfit, files));
    return fail(with_advice(arrangement.error(), repetition, fisheyes));
  }
  NODAL_TRY(check_different(arrangement->used, count, files));
  Found found;
  found.calibration.name = "from pictures";
  found.calibration.comment = "Lens and rotations from the pictures alone.";
  for (std::size_t h = 0; h < count; ++h) {
    const auto& R = arrangement->R_head_rig[h];
    if (!R) continue;
    found.placed.push_back(h);
    found.calibration.heads.push_back(head_of(shapes[h], arrangement->lens_of(h), *R, names[h]));
  }
  found.matches = static_cast<int>(arrangement->used.size());
  found.error_px = arrangement->error * shapes.front().unit();
  found.lens = arrangement->evidence;
  if (!found.placed.empty()) found.unit_px = shapes[found.placed.front()].unit();
  add_points(*arrangement, found);
  add_doubtful(*arrangement, overlaps, found);
  if (found.placed.size() < count && !repetition.prevails()) found.misfits = misfits_of(search, *arrangement);
  NODAL_TRY(check_calibration(found.calibration));
  NODAL_TRY(turn_upright(small, options.up, found));
  tell(1);
  return found;
}

}  // namespace nodal::autocalibration
