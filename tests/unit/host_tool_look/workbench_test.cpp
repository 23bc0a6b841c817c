// Heads that are placed by hand: every change that the page can ask for, on pictures of a rendered rig.
#include "host_tool/look/workbench.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "host_tool/console/overwriting.h"
#include "protocol/calibration.h"
#include "stitch/geometry/rotation.h"
#include "stitch/mesh/mesh_file.h"
#include "tests/support/pictures.h"
#include "tests/support/rendered_rig.h"
#include "workbench_fixture.h"

namespace nodal::host::look {
namespace {

TEST_F(Bench, TrianglesOfAHead_ShowEachPixelInItsDirection) {
  start(town().truth);
  const Json scene = parsed(bench_->answer({"scene.json", {}}));
  ASSERT_EQ(scene["heads"].size(), 6u);
  const mesh::Raymesh mesh =
      mesh::decode_mesh(*bench_->answer({"grid.glb", {{"head", "2"}}}).body, mesh::MeshFormat::kGlb).value();
  ASSERT_GT(mesh.triangles.size(), 1000u);
  // An equidistant lens: the angle from the axis is the distance from the centre by the focal length.
  const double focal = kSide / 2.0 / (kView / 2 * kDegree);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(0, 1);
  double worst = 0;
  for (const mesh::Raymesh::Triangle& triangle : mesh.triangles) {
    double a = any(random), b = any(random);
    if (a + b > 1) a = 1 - a, b = 1 - b;
    const Eigen::Vector3d at =
        (1 - a - b) * mesh.point(triangle[0]) + a * mesh.point(triangle[1]) + b * mesh.point(triangle[2]);
    const Eigen::Vector2d place = (1 - a - b) * mesh.vertices[triangle[0]].texture +
                                  a * mesh.vertices[triangle[1]].texture + b * mesh.vertices[triangle[2]].texture;
    const Eigen::Vector2d from = place * kSide - Eigen::Vector2d(kSide / 2.0, kSide / 2.0);
    const double angle = from.norm() / focal;
    const Eigen::Vector3d exact(std::sin(angle) * from.x() / from.norm(), std::sin(angle) * from.y() / from.norm(),
                                std::cos(angle));
    worst = std::max(worst, std::atan2(exact.cross(at).norm(), exact.dot(at)) / kDegree);
  }
  EXPECT_LE(worst, 0.1);
  EXPECT_LE(scene["heads"][2]["error_deg"].get<double>(), 0.1);
}

TEST_F(Bench, ATurn_TurnsTheChosenHeadsAndNoOthers_AndIsUndoneAndRedone) {
  start(town().truth);
  const Json before = state();
  const Eigen::Vector3d about(0.3, -0.2, 0.5);
  const Json after = parsed(change({{"do", "turn"}, {"heads", {1, 4}}, {"about", list(about)}}));
  const Eigen::Matrix3d R = Eigen::AngleAxisd(about.norm(), about.normalized()).toRotationMatrix();
  for (std::size_t k = 0; k < 6; ++k) {
    const Eigen::Matrix3d expected =
        k == 1 || k == 4 ? Eigen::Matrix3d(R * axes(before["heads"][k])) : axes(before["heads"][k]);
    EXPECT_TRUE(axes(after["heads"][k]).isApprox(expected, 1e-9)) << k;
  }
  EXPECT_NEAR(after["heads"][1]["turned_deg"].get<double>(), about.norm() / kDegree, 1e-6);
  EXPECT_TRUE(after["undo"]);
  const Json undone = parsed(change({{"do", "undo"}}));
  EXPECT_EQ(undone["heads"], before["heads"]);
  EXPECT_FALSE(undone["undo"]);
  EXPECT_TRUE(undone["redo"]);
  EXPECT_EQ(parsed(change({{"do", "redo"}}))["heads"], after["heads"]);
  EXPECT_EQ(change({{"do", "redo"}}).status, 400u) << "nothing is left to redo";
}

TEST_F(Bench, PointsOnTheHorizonOrOneAboveTheOther_MakeTheRigLevel) {
  const Eigen::Matrix3d tilt = Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.6, 0, 0.8)).toRotationMatrix();
  const Eigen::Vector3d up = tilt * Eigen::Vector3d(0, 1, 0);  // what is up in the tilted rig, in the axes of graphics
  const Eigen::Vector3d east = tilt * Eigen::Vector3d(1, 0, 0), north = tilt * Eigen::Vector3d(0, 0, -1);
  for (const bool horizon : {true, false}) {
    start(town().truth);
    const Json before = state();
    // The horizon: three directions at right angles to up. One vertical line needs help: the least turn that makes it
    // vertical leaves the tilt about it.
    const Json points = horizon ? Json{list(east), list(north), list(-(east + north))}
                                : Json{list(north + 0.5 * up), list(north), list(north - 0.4 * up)};
    const Json after = parsed(change({{"do", horizon ? "level" : "upright"}, {"points", points}}));
    const Eigen::Matrix3d R = axes(after["heads"][0]) * axes(before["heads"][0]).transpose();
    if (horizon) {
      EXPECT_NEAR((R * up - Eigen::Vector3d(0, 1, 0)).norm(), 0, 1e-9);
      EXPECT_NEAR(std::acos(std::clamp((R.trace() - 1) / 2, -1.0, 1.0)), std::acos(up.y()), 1e-6) << "no larger turn";
    } else {
      const Eigen::Vector3d normal = (R * north).cross(R * up);
      EXPECT_NEAR(normal.y(), 0, 1e-9) << "the line is in a vertical plane";
    }
  }
  EXPECT_EQ(change({{"do", "level"}, {"points", {{1, 0, 0}, {1, 0.001, 0}}}}).status, 400u) << "too close together";
}

// Slid by hand to about 2 degrees, ten pairs a neighbour clicked 5 px off, then the program's own registration.
TEST_F(Bench, FromHeadsTurnedBy25Degrees_SlidesPairsAndRegistration_FindTheTruth) {
  const Calibration& truth = town().truth;
  start(test::turned(truth, 20, 25, 7));
  std::mt19937 random(45);
  std::uniform_real_distribution<double> any(-1, 1);
  for (std::size_t k = 0; k < 6; ++k) {
    // Two slides: a direction to its place, and the roll about it; each a degree off or so.
    const Eigen::Matrix3d is = axes(state()["heads"][k]);
    Eigen::Matrix3d goal = geometry::matrix_of(truth.heads[k].R_head_rig).transpose();
    const Eigen::Vector3d flip(1, -1, -1);
    goal = flip.asDiagonal() * goal * flip.asDiagonal();
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(goal * is.transpose()));
    const Eigen::Vector3d off(any(random), any(random), any(random));
    parsed(change({{"do", "turn"}, {"heads", {k}}, {"about", list(turn.angle() * turn.axis() + 1.5 * kDegree * off)}}));
  }
  const std::vector<geometry::Head> heads = geometry::make_heads(truth).value();
  int clicked = 0, proposed = 0;
  std::vector<double> off_px;
  double worst_proposed_px = 0;
  for (std::size_t a = 0; a < 6; ++a) {
    for (std::size_t b = a + 1; b < 6; ++b) {
      int pairs = 0;
      for (int tries = 0; tries < 4000 && pairs < 10; ++tries) {
        const geometry::Ray ray = geometry::Ray::towards(any(random), any(random), any(random));
        const auto in_a = heads[a].project(ray), in_b = heads[b].project(ray);
        if (!in_a || !in_b || heads[a].distance_to_edge(*in_a) < 12 || heads[b].distance_to_edge(*in_b) < 12) continue;
        const double angle = any(random) * std::numbers::pi;
        const geometry::Pixel click{in_b->x + 5 * std::cos(angle), in_b->y + 5 * std::sin(angle)};
        const Json found = proposal(a, *in_a, b, click);
        // People click where there is something to recognize.
        if (!found["found"] || found["correlation"].get<double>() < 0.97) continue;
        const double off = std::hypot(found["x"].get<double>() - in_b->x, found["y"].get<double>() - in_b->y);
        off_px.push_back(off);
        ++clicked, ++pairs;
        if (const Json alone = proposal(a, *in_a, b, std::nullopt);
            alone["found"] && alone["correlation"].get<double>() > 0.97) {
          ++proposed;
          worst_proposed_px = std::max(
              worst_proposed_px, std::hypot(alone["x"].get<double>() - in_b->x, alone["y"].get<double>() - in_b->y));
        }
        parsed(change({{"do", "add_pair"},
                       {"a", a},
                       {"x", in_a->x},
                       {"y", in_a->y},
                       {"b", b},
                       {"bx", found["x"]},
                       {"by", found["y"]}}));
      }
      EXPECT_TRUE(pairs == 10 || pairs == 0) << a << ' ' << b << ": " << pairs;
    }
  }
  std::ranges::sort(off_px);
  std::printf("%d pairs, refined to %.3f px (nine of ten), %.3f px (worst); %d proposed without a click, %.3f px\n",
              clicked, off_px[off_px.size() * 9 / 10], off_px.back(), proposed, worst_proposed_px);
  ASSERT_GE(clicked, 100);
  EXPECT_LE(off_px[off_px.size() * 9 / 10], 0.3);
  EXPECT_LE(off_px.back(), 1);
  const Json fitted = parsed(change({{"do", "fit"}}));
  EXPECT_EQ(fitted["agreements"].size(), 12u) << "the edges of a cube";
  for (const Json& each : fitted["agreements"]) EXPECT_LT(each["worst_deg"].get<double>(), 0.3) << each;
  parsed(change({{"do", "register"}, {"free", "rotations"}}));
  EXPECT_EQ(change({{"do", "undo"}}).status, 409u) << "while it runs, nothing else changes the heads";
  const Json done = registered();
  EXPECT_EQ(done["registered"]["error"], "");
  EXPECT_LT(done["registered"]["levels_after"].get<double>(), done["registered"]["levels_before"].get<double>());
  parsed(change({{"do", "save"}}));
  const test::RotationError error = test::rotation_error(truth, parse_calibration(saved()).value());
  std::printf("registered to %.5f degrees rms, %.5f worst; a pixel is %.3f degrees\n", error.rms_deg, error.max_deg,
              kView / kSide);
  EXPECT_LT(error.rms_deg, 0.005 * kView / kSide);
}

TEST_F(Bench, AnOutlierIsMarked_AndResidualsAreThoseOfTheRays) {
  start(town().truth);
  const std::vector<geometry::Head> heads = geometry::make_heads(town().truth).value();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1, 1);
  int count = 0;
  while (count < 12) {
    const geometry::Ray ray = geometry::Ray::towards(any(random), any(random), any(random));
    const auto a = heads[0].project(ray), b = heads[1].project(ray);
    if (!a || !b || heads[0].distance_to_edge(*a) < 9 || heads[1].distance_to_edge(*b) < 9) continue;
    const double wrong = count == 5 ? 8 : 0;  // px
    parsed(
        change({{"do", "add_pair"}, {"a", 0}, {"x", a->x}, {"y", a->y}, {"b", 1}, {"bx", b->x}, {"by", b->y + wrong}}));
    ++count;
  }
  const Json now = state();
  for (std::size_t k = 0; k < 12; ++k) {
    EXPECT_EQ(now["pairs"][k]["outlier"], k == 5) << k;
    if (k == 5) EXPECT_GT(now["pairs"][k]["residual_deg"].get<double>(), 2);
    else EXPECT_LT(now["pairs"][k]["residual_deg"].get<double>(), 1e-6) << k;
  }
  EXPECT_EQ(now["agreements"][0]["pairs"], 11);
  parsed(change({{"do", "remove_pair"}, {"index", 5}}));
  EXPECT_EQ(state()["pairs"].size(), 11u);
  parsed(change({{"do", "undo"}}));
  EXPECT_EQ(state()["pairs"].size(), 12u) << "pairs are undone, too";
}

TEST_F(Bench, ContradictingPairs_AreRefusedOrMarked_AndAnsweredInTime) {
  start(town().truth);
  Json pair{{"do", "add_pair"}, {"a", 0}, {"x", 200}, {"y", 120}, {"b", 1}, {"bx", 40}, {"by", 120}};
  for (const int by : {60, 180, 100, 150, 80, 70}) {
    pair["y"] = 240 - by;
    pair["by"] = by;
    parsed(change(pair));
  }
  const Answer fit = change({{"do", "fit"}});
  EXPECT_TRUE(fit.status == 200 || fit.status == 400) << text_of(fit);
  for (int k = 0; k < 100; ++k) parsed(change(pair));
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(state()["pairs"].size(), 106u);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(500));
}

TEST_F(Bench, MorePairsThanAreAllowed_AreRefusedInASentence) {
  start(town().truth, 20);
  const Json pair{{"do", "add_pair"}, {"a", 0}, {"x", 200}, {"y", 120}, {"b", 1}, {"bx", 40}, {"by", 120}};
  for (int k = 0; k < 20; ++k) parsed(change(pair));
  const Answer refused = change(pair);
  EXPECT_EQ(refused.status, 400u);
  EXPECT_NE(text_of(refused).find("20 pairs"), std::string::npos) << text_of(refused);
  EXPECT_EQ(state()["pairs"].size(), 20u);
}

TEST_F(Bench, TwoPages_TheLaterChangeOfTheSameStateIsRefused) {
  start(town().truth);
  const auto revision = state()["revision"].get<std::uint64_t>();
  const Json turn{{"do", "turn"}, {"heads", {0}}, {"about", {0, 0.1, 0}}};
  EXPECT_EQ(change(turn, revision).status, 200u);
  const Json once = state();
  const Answer again = change(turn, revision);
  EXPECT_EQ(again.status, 409u);
  EXPECT_NE(text_of(again).find("Another page"), std::string::npos);
  EXPECT_EQ(state(), once);
}

TEST_F(Bench, RequestsThatMakeNoSense_AreRefusedAndChangeNothing) {
  start(town().truth);
  const Json before = state();
  for (const char* const words :
       {R"({"do":"turn"})", R"({"do":"turn","heads":[],"about":[0,0,1]})",
        R"({"do":"turn","heads":[6],"about":[0,0,1]})", R"({"do":"turn","heads":[-1],"about":[0,0,1]})",
        R"({"do":"turn","heads":[0],"about":[0,null,1]})", R"({"do":"turn","heads":[0],"about":[0,1e300,1]})",
        R"({"do":"turn","heads":[0],"about":[0,1]})", R"({"do":"level","points":[[1,0,0]]})",
        R"({"do":"level","points":[[0,0,0],[1,0,0]]})", R"({"do":"fit"})",
        R"({"do":"add_pair","a":0,"x":100,"y":100,"b":0,"bx":5,"by":5})",
        R"({"do":"add_pair","a":0,"x":-5,"y":100,"b":1,"bx":50,"by":50})", R"({"do":"remove_pair","index":0})",
        R"({"do":"register","free":"all"})", R"({"do":"undo"})", R"({"do":"dance"})"}) {
    const Answer answer = change(Json::parse(words));
    EXPECT_EQ(answer.status, 400u) << words;
    EXPECT_GT(text_of(answer).size(), 10u) << words;
  }
  for (const char* const body : {"", "[]", "null", "{\"do\":\"undo\"}", "{\"revision\":-1,\"do\":\"undo\"}", "{"})
    EXPECT_EQ(bench_->answer({"change", {}, true, body}).status, 400u) << body;
  EXPECT_EQ(bench_->answer({"state.json", {}, true, "{}"}).status, 404u) << "a POST to what is only read";
  for (const char* const name : {"grid.glb", "head"}) EXPECT_EQ(bench_->answer({name, {{"head", "6"}}}).status, 400u);
  EXPECT_EQ(bench_->answer({"proposal", {{"a", "0"}, {"b", "0"}, {"x", "1"}, {"y", "1"}}}).status, 400u);
  EXPECT_EQ(bench_->answer({"seen", {{"x", "0"}, {"y", "0"}, {"z", "0"}}}).status, 400u);
  EXPECT_EQ(state(), before);
}

TEST_F(Bench, SeenBy_GivesThePixelsOfTheHeadsThatSeeADirection) {
  start(town().truth);
  // Head 0 looks forward, -z in the axes of graphics; 30 degrees to the right of it, head 1, which looks right, sees
  // what is 60 degrees from its axis.
  const Json seen = parsed(bench_->answer(
      {"seen",
       {{"x", std::to_string(std::sin(30 * kDegree))}, {"y", "0"}, {"z", std::to_string(-std::cos(30 * kDegree))}}}));
  const std::vector<geometry::Head> heads = geometry::make_heads(town().truth).value();
  int expected = 0;
  for (const geometry::Head& head : heads) {
    const auto pixel = head.project(geometry::Ray::towards(std::sin(30 * kDegree), 0, std::cos(30 * kDegree)));
    expected += pixel && head.contains(*pixel) ? 1 : 0;
  }
  ASSERT_EQ(seen.size(), static_cast<std::size_t>(expected));
  EXPECT_GE(expected, 2);
}

TEST_F(Bench, Save_NeverWritesOverAFileWithoutBeingAsked_AndAFullDiskIsSaid) {
  set_overwriting(false);
  start(town().truth);
  test::write_bytes(folder_ / "placed.json", {'o', 'l', 'd'});
  const Answer refused = change({{"do", "save"}});
  EXPECT_EQ(refused.status, 409u);
  EXPECT_NE(text_of(refused).find("placed.json"), std::string::npos) << text_of(refused);
  EXPECT_EQ(saved(), "old");
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{100, before.rlim_max};  // bytes of a file: writing fails as on a full disk
  ::setrlimit(RLIMIT_FSIZE, &small);
  const Answer full = change({{"do", "save"}, {"replace", true}});
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_GE(full.status, 500u);
  EXPECT_NE(text_of(full).find("placed.json"), std::string::npos) << text_of(full);
  EXPECT_EQ(saved(), "old") << "the old file stays whole";
  EXPECT_EQ(parsed(change({{"do", "save"}, {"replace", true}}))["saved"], (folder_ / "placed.json").string());
  EXPECT_EQ(parse_calibration(saved()).value(), town().truth);
}

}  // namespace
}  // namespace nodal::host::look
