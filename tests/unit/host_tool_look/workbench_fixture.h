// Heads of a rendered town on a workbench, and requests to it as the page makes them.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <chrono>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host_tool/look/workbench.h"
#include "protocol/calibration.h"
#include "tests/support/pictures.h"
#include "tests/support/rendered_rig.h"

namespace nodal::host::look {

using Json = nlohmann::json;

inline constexpr int kSide = 240;
inline constexpr double kView = 130, kDegree = std::numbers::pi / 180;

class Bench : public testing::Test {
 protected:
  static const test::RenderedRig& town() {
    static const test::RenderedRig rig = test::render_rig(
        test::six_fisheyes(kSide, kView), hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 0, 5, 4});
    return rig;
  }
  void start(const Calibration& prior, std::size_t max_pairs = 10'000) {
    RigPictures rig;
    rig.calibration = prior;
    for (const HeadCalibration& head : prior.heads) rig.heads.push_back(head.name);
    std::vector<HeadPicture>& pictures = rig.sets.emplace_back();
    for (const std::vector<std::uint8_t>& bytes : town().bytes)
      pictures.emplace_back(DecodedImage{PixelFormat::kGrey8, kSide, kSide, bytes, {}, {}});
    bench_ = Workbench::make(std::move(rig), {"rig.json", (folder_ / "placed.json").string(), 1, max_pairs}).value();
  }
  Json state() const { return parsed(bench_->answer({"state.json", {}})); }
  static Json parsed(const Answer& answer) {
    EXPECT_EQ(answer.status, 200u) << text_of(answer);
    return Json::parse(answer.body->begin(), answer.body->end());
  }
  static std::string text_of(const Answer& answer) { return {answer.body->begin(), answer.body->end()}; }
  Answer change(Json words, std::optional<std::uint64_t> revision = std::nullopt) const {
    words["revision"] = revision ? *revision : state()["revision"].get<std::uint64_t>();
    return bench_->answer({"change", {}, true, words.dump()});
  }
  /// Directions in the axes of graphics.
  static Eigen::Vector3d graphics(const Eigen::Vector3d& v) { return {v.x(), -v.y(), -v.z()}; }
  static Json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
  /// The rotation from a head's axes to the rig's, in the axes of graphics.
  static Eigen::Matrix3d axes(const Json& head) {
    Eigen::Matrix3d R;
    for (int k = 0; k < 9; ++k) R(k / 3, k % 3) = head["axes"][static_cast<std::size_t>(k)];
    return R;
  }
  Json proposal(std::size_t a, geometry::Pixel at, std::size_t b, std::optional<geometry::Pixel> near) const {
    std::map<std::string, std::string> query{
        {"a", std::to_string(a)}, {"b", std::to_string(b)}, {"x", std::to_string(at.x)}, {"y", std::to_string(at.y)}};
    if (near) query["bx"] = std::to_string(near->x), query["by"] = std::to_string(near->y);
    return parsed(bench_->answer({"proposal", query}));
  }
  Json registered() const {
    for (int k = 0; k < 6000; ++k) {
      const Json now = state();
      if (now["registering"].is_null()) return now;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ADD_FAILURE() << "the registration does not end";
    return {};
  }
  std::string saved() const {
    const std::vector<std::uint8_t> bytes = test::read_bytes(folder_ / "placed.json");
    return {bytes.begin(), bytes.end()};
  }

  test::TemporaryFolder folder_;
  std::unique_ptr<Workbench> bench_;
};

}  // namespace nodal::host::look
