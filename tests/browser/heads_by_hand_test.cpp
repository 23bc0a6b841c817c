// Heads that are turned by 20 to 25 degrees, registered in the page of `nodal look` only by mouse and keys: slid,
// paired by clicks, fitted, registered by the program, saved.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include "heads_page.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"

namespace nodal::command_line {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kSlipDeg = 2.5;              // how far slides are off: 5 px of a head
constexpr double kRollByPx = 0.2 * kRadians;  // roll of a head by a drag with Shift
constexpr int kPairs = 12;                    // clicks for each two neighbours
constexpr int kFeature = 6;                   // px around a click where there is something to recognize

/// A direction, or a rotation of directions, in the axes of graphics.
Vector3d graphics(const Vector3d& v) { return {v.x(), -v.y(), -v.z()}; }
Matrix3d graphics_axes(const HeadCalibration& head) {
  const Vector3d flip(1, -1, -1);
  return flip.asDiagonal() * geometry::matrix_of(head.R_head_rig).transpose() * flip.asDiagonal();
}

/// What the page shows, as the script knows it.
struct PageView {
  double width = 0, height = 0, focal = 0, yaw = 0, pitch = 0;

  Matrix3d axes() const {
    return (Eigen::AngleAxisd(-yaw * kRadians, Vector3d::UnitY()) *
            Eigen::AngleAxisd(pitch * kRadians, Vector3d::UnitX()))
        .toRotationMatrix();
  }
  Vector3d ray(const Eigen::Vector2d& at) const {
    return axes() * Vector3d(at.x() - width / 2, height / 2 - at.y(), -focal).normalized();
  }
  /// The nearest whole pixel.
  Eigen::Vector2d pixel(const Vector3d& direction) const {
    const Vector3d v = axes().transpose() * direction;
    return {std::round(width / 2 - focal * v.x() / v.z()), std::round(height / 2 + focal * v.y() / v.z())};
  }
};

class HeadsByHand : public HeadsPage {
 protected:
  static constexpr int kLook = 0, kSlide = 1, kPair = 2;  // numbers of the tools
  void tool(int k) { steps_.push_back({"select", "tool", k}); }
  void press(const std::string& id) { steps_.push_back({"press", id}); }
  /// Turns the view by keys, in steps of 5 degrees.
  void look(double yaw, double pitch) {
    tool(kLook);
    steps_.push_back({"drag", 3, 3, 3, 3});  // it gets the keys
    const int right = static_cast<int>(std::lround((yaw - view_.yaw) / 5)),
              up = static_cast<int>(std::lround((pitch - view_.pitch) / 5));
    if (right != 0) steps_.push_back({"keys", right > 0 ? "ArrowRight" : "ArrowLeft", std::abs(right)});
    if (up != 0) steps_.push_back({"keys", up > 0 ? "ArrowUp" : "ArrowDown", std::abs(up)});
    view_.yaw = yaw;
    view_.pitch = pitch;
  }
  void look_at(const Vector3d& direction) {
    const double pitch = std::asin(std::clamp(direction.y(), -1.0, 1.0)) / kRadians;
    look(std::abs(pitch) > 89 ? view_.yaw : std::atan2(direction.x(), -direction.z()) / kRadians, pitch);
  }
  /// Slides a head near to its place: its axis by a drag, then the roll about it.
  void slide(std::size_t head) {
    const Matrix3d goal = graphics_axes(rig_.truth.heads[head]);
    const Vector3d forward(0, 0, -1);
    look_at(goal * forward);
    tool(kSlide);
    press("#head" + std::to_string(head));
    const double slip = view_.focal * std::tan(kSlipDeg * kRadians), about = 1.3 * static_cast<double>(head);
    const Eigen::Vector2d from = view_.pixel(is_[head] * forward),
                          to(std::round(view_.width / 2 + slip * std::cos(about)),
                             std::round(view_.height / 2 + slip * std::sin(about)));
    steps_.push_back({"drag", from.x(), from.y(), to.x(), to.y()});
    is_[head] = Eigen::Quaterniond::FromTwoVectors(view_.ray(from), view_.ray(to)).toRotationMatrix() * is_[head];
    // The roll that brings it nearest to its place.
    const Vector3d n = view_.ray(to);
    const Matrix3d M = is_[head] * goal.transpose();
    const Vector3d skew(M(1, 2) - M(2, 1), M(2, 0) - M(0, 2), M(0, 1) - M(1, 0));
    const double roll = std::atan2(n.dot(skew), M.trace() - n.dot(M * n));
    const int pixels = static_cast<int>(std::lround(roll / kRollByPx));
    if (pixels != 0) steps_.push_back({"roll", to.x(), to.y(), pixels});
    is_[head] = Eigen::AngleAxisd(pixels * kRollByPx, n).toRotationMatrix() * is_[head];
    press("#head" + std::to_string(head));
  }
  /// How much there is to recognize about a pixel: the smaller eigenvalue of its structure tensor.
  double feature(std::size_t head, const geometry::Pixel& at) const {
    const auto grey = [&](int x, int y) {
      return double{1.0 * rig_.bytes[head].at(static_cast<std::size_t>(3 * (y * kSide + x) + 1))};
    };
    Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
    const int cx = static_cast<int>(at.x), cy = static_cast<int>(at.y);
    for (int y = cy - kFeature; y <= cy + kFeature; ++y) {
      for (int x = cx - kFeature; x <= cx + kFeature; ++x) {
        const Eigen::Vector2d slope(grey(x + 1, y) - grey(x - 1, y), grey(x, y + 1) - grey(x, y - 1));
        sum += slope * slope.transpose();
      }
    }
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(sum).eigenvalues().x();
  }
  /// Clicks what can be recognized between two neighbours.
  void click_pairs(std::size_t a, std::size_t b, const std::vector<geometry::Head>& truth) {
    const Vector3d forward(0, 0, -1);
    const Vector3d in_a = graphics_axes(rig_.truth.heads[a]) * forward,
                   in_b = graphics_axes(rig_.truth.heads[b]) * forward;
    look_at((in_a + in_b).normalized());
    tool(kPair);
    press("#head" + std::to_string(a));
    std::vector<std::pair<double, Eigen::Vector2d>> found;
    for (double x = 0.2; x < 0.81; x += 0.025) {
      for (double y = 0.2; y < 0.81; y += 0.025) {
        const Eigen::Vector2d at(std::round(x * view_.width), std::round(y * view_.height));
        // The pixel of head a that is shown there, and where head b sees the same.
        const Vector3d in_head = graphics(is_[a].transpose() * view_.ray(at));
        const Vector3d in_rig = geometry::matrix_of(rig_.truth.heads[a].R_head_rig).transpose() * in_head;
        const geometry::Ray ray = geometry::Ray::towards(in_rig.x(), in_rig.y(), in_rig.z());
        const auto pixel = truth[a].project(ray), other = truth[b].project(ray);
        const auto inside = [&](std::size_t k, const auto& p) { return p && truth[k].distance_to_edge(*p) > 16; };
        if (inside(a, pixel) && inside(b, other)) found.emplace_back(feature(a, *pixel), at);
      }
    }
    std::ranges::sort(found, [](const auto& one, const auto& two) { return one.first > two.first; });
    std::vector<Eigen::Vector2d> clicked;
    for (const auto& [value, at] : found) {
      const bool apart = std::ranges::all_of(clicked, [&at = at](const auto& p) { return (p - at).norm() > 25; });
      if (!apart || clicked.size() == kPairs) continue;
      clicked.push_back(at);
      steps_.push_back({"click", at.x(), at.y()});
      steps_.push_back({"key", "Escape"});  // nothing is left of a place that was not found again
    }
    press("#head" + std::to_string(a));
  }

  PageView view_;
  std::vector<Matrix3d> is_;  ///< how the heads are turned now
  Json steps_;
};

TEST_F(HeadsByHand, TurnedBy25Degrees_SlidesPairsAndRegistration_FindTheTruthAsWellAsFromTheTruth) {
  const Words words = write_rig(20, 25, 7);
  const Json page{{"size", 640, 700}, {"open"}, {"state"}};
  const Json opened = drive(words, page).at(1);
  view_.width = opened["width"];
  view_.height = opened["height"];
  view_.focal = view_.width / 2 / std::tan(opened["fov"].get<double>() / 2 * kRadians);
  for (const HeadCalibration& head : prior_.heads) is_.push_back(graphics_axes(head));
  const std::vector<geometry::Head> truth = geometry::make_heads(rig_.truth).value();
  steps_ = page;
  steps_.push_back({"shot", "begin.png", "page"});
  for (std::size_t head = 0; head < 6; ++head) slide(head);
  steps_.push_back({"heads"});
  look(0, 0);
  steps_.push_back({"shot", "slid.png", "page"});
  int neighbours = 0;
  for (std::size_t a = 0; a < 6; ++a) {
    for (std::size_t b = a + 1; b < 6; ++b) {
      const double cosine = (graphics_axes(rig_.truth.heads[a]).col(2)).dot(graphics_axes(rig_.truth.heads[b]).col(2));
      if (std::abs(cosine) > 0.5) continue;
      click_pairs(a, b, truth);
      ++neighbours;
    }
  }
  ASSERT_EQ(neighbours, 12) << "the edges of a cube";
  for (const Json& step : {Json{"heads"}, Json{"shot", "pairs.png", "page"}, Json{"press", "#fit"}, Json{"heads"},
                           Json{"press", "#register"}, Json{"until", "Registered"},
                           Json{"shot", "registered.png", "page"}, Json{"press", "#save"}, Json{"until", "Saved as"}})
    steps_.push_back(step);
  const std::vector<Json> seen = drive(words, steps_);
  ASSERT_EQ(seen.size(), 5u);
  for (std::size_t k = 0; k < 6; ++k) {
    const double off = Eigen::AngleAxisd(Matrix3d(axes(seen[2]["heads"][k]) * is_[k].transpose())).angle() / kRadians;
    EXPECT_LT(off, 0.01) << "head " << k << " is where the script has slid it";
  }
  std::vector<double> off_px;
  std::array<std::array<int, 6>, 6> count{};
  for (const Json& pair : seen[3]["pairs"]) {
    const std::size_t a = pair["a"], b = pair["b"];
    ++count[std::min(a, b)][std::max(a, b)];
    const auto ray = truth[a].unproject({pair["pixel_a"][0], pair["pixel_a"][1]});
    ASSERT_TRUE(ray);
    const auto place = truth[b].project(*ray);
    ASSERT_TRUE(place);
    off_px.push_back(
        std::hypot(pair["pixel_b"][0].get<double>() - place->x, pair["pixel_b"][1].get<double>() - place->y));
  }
  std::ranges::sort(off_px);
  ASSERT_GE(off_px.size(), 100u);
  std::printf("%zu pairs, refined to %.3f px (median), %.3f px (nine of ten), %.3f px (worst)\n", off_px.size(),
              off_px[off_px.size() / 2], off_px[off_px.size() * 9 / 10], off_px.back());
  EXPECT_LE(off_px[off_px.size() * 9 / 10], 0.3);
  for (std::size_t a = 0; a < 6; ++a)
    for (std::size_t b = a + 1; b < 6; ++b)
      EXPECT_TRUE(count[a][b] == 0 || count[a][b] >= 8) << a << ' ' << b << ' ' << count[a][b];
  const auto error_of = [&](const std::string& file) {
    const std::vector<std::uint8_t> bytes = test::read_bytes(path(file));
    return test::rotation_error(rig_.truth, parse_calibration(std::string(bytes.begin(), bytes.end())).value());
  };
  // The program's own registration that begins at the truth shows what the pictures allow.
  std::ofstream(path("truth.json")) << to_json(rig_.truth);
  Words register_words{"register", path("truth.json")};
  for (const HeadCalibration& head : rig_.truth.heads) register_words.push_back(path(head.name + ".png"));
  register_words.insert(register_words.end(), {"-o", path("best.json")});
  const test::Finished best = nodal(register_words);
  ASSERT_EQ(best.code, 0) << best.err;
  const test::RotationError by_hand = error_of("placed.json"), by_truth = error_of("best.json");
  std::printf("registered to %.5f degrees rms, from the truth to %.5f; a pixel is %.3f degrees\n", by_hand.rms_deg,
              by_truth.rms_deg, 130.0 / kSide);
  EXPECT_LT(by_hand.rms_deg, 1.1 * by_truth.rms_deg + 1e-5);
}

}  // namespace
}  // namespace nodal::command_line
