#include "stitch/calibration/lens/find_pattern.h"

#include <fmt/format.h>

#include <algorithm>

#include "stitch/calibration/lens/scale_space.h"

namespace nodal::calibration {
namespace {

constexpr int kPhotoFeatures = 3000;
constexpr int kPatternFeatures = 6000;
constexpr int kPhotoSide = 1600;  // px; larger pictures are halved before the search
constexpr int kPatternSide = 2048;
constexpr double kTolerance = 0.008;  // share of the photograph's width, because centre and aspect are only estimates

struct Small {
  GreyImage image;
  double px = 1;
};

Small halved_to(GreyImage image, int side) {
  Small small{std::move(image), 1};
  while (std::max(small.image.width, small.image.height) > side) {
    small.image = halved(small.image);
    small.px *= 2;
  }
  return small;
}

GreyImage encoded(const PatternRaster& raster) {
  GreyImage image(raster.width, raster.height);
  for (std::size_t i = 0; i < raster.values.size(); ++i) {
    image.values[i] = static_cast<float>(raster.values[i]) / 255.0F;
  }
  return image;
}

}  // namespace

PatternFinder::PatternFinder(const PatternRaster& pattern) : width_(pattern.width), height_(pattern.height) {
  const Small small = halved_to(encoded(pattern), kPatternSide);
  features_ = find_features(small.image, kPatternFeatures);
  px_ = small.px;
}

Result<RadialPose> PatternFinder::find(const GreyImage& photo, const std::string& name, const Eigen::Vector2d& center,
                                       double aspect) const {
  const Small small = halved_to(photo, kPhotoSide);
  const Features features = find_features(small.image, kPhotoFeatures);
  std::vector<PointPair> pairs;
  for (const Match& match : match_features(features, features_)) {
    const Feature& p = features.points[static_cast<std::size_t>(match.photo)];
    const Feature& q = features_.points[static_cast<std::size_t>(match.pattern)];
    pairs.push_back({{p.x * small.px, p.y * small.px},
                     {(q.x * px_ - width_ / 2.0) / width_, (q.y * px_ - height_ / 2.0) / width_}});
  }
  std::optional<RadialPose> pose = radial_pose(pairs, center, aspect, kTolerance * photo.width);
  if (!pose) {
    return fail(Errc::kNotDetermined,
                fmt::format("{}: the pattern is not in this photograph ({} points resemble it, and they do not agree); "
                            "it must be the pattern that was printed, sharp, not mirrored, and fill at least a quarter "
                            "of the picture. Leave this one out, or give the printed file with --pattern",
                            name, pairs.size()));
  }
  return std::move(*pose);
}

}  // namespace nodal::calibration
