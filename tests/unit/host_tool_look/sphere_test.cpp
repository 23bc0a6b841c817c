// What the page gets of a raymap.
#include "host_tool/look/sphere.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tool/look/shrink.h"
#include "stitch/media/image_file.h"
#include "stitch/mesh/mesh_file.h"
#include "tests/support/layouts.h"
#include "tests/support/pictures.h"

namespace nodal::host::look {
namespace {

using Json = nlohmann::json;

class LookedAt : public testing::Test {
 protected:
  std::string write_png(const std::string& name, int width, int height) const {
    test::write_bytes(folder_ / name, test::png_of(test::smooth_rgb(width, height), width, height, 3));
    return (folder_ / name).string();
  }
  static std::unique_ptr<Sphere> read(const std::string& file, const std::string& from) {
    auto sphere = Sphere::read({file, from, usual_envelopes(), 1});
    EXPECT_TRUE(sphere) << (sphere ? "" : sphere.error().message);
    return sphere ? *std::move(sphere) : nullptr;
  }
  static Json scene_of(Sphere& sphere) {
    const Answer answer = sphere.answer({"scene.json", {}});
    return Json::parse(answer.body->begin(), answer.body->end());
  }
  static mesh::Raymesh mesh_of(Sphere& sphere, int envelope) {
    const Answer answer = sphere.answer({"mesh.glb", {{"envelope", std::to_string(envelope)}}});
    EXPECT_EQ(answer.status, 200u) << std::string(answer.body->begin(), answer.body->end());
    return mesh::decode_mesh(*answer.body, mesh::MeshFormat::kGlb).value();
  }

  test::TemporaryFolder folder_;
};

TEST_F(LookedAt, APngOrJpegInSrgb_IsGivenAsItIs) {
  const std::string png = write_png("a.png", 256, 128);
  const auto sphere = read(png, "equirectangular");
  const Answer answer = sphere->answer({"picture", {{"side", "4096"}}});
  EXPECT_EQ(answer.type, "image/png");
  EXPECT_EQ(*answer.body, test::read_bytes(png));
  const Json scene = scene_of(*sphere);
  EXPECT_EQ(scene["layout"], "equirectangular");
  EXPECT_EQ(scene["width"], 256);
  EXPECT_EQ(scene["envelopes"].size(), 6u);
  EXPECT_EQ(scene["flat"], "");
}

TEST_F(LookedAt, AnEye_MayBeWhereItSeesInnerSidesOnly) {
  // A cube with a hollow in one face: an eye beside the hollow sees one of its sides from behind.
  const std::string dented =
      "v -1 1 -1\nv 1 1 -1\nv 1 1 1\nv -1 1 1\nv -1 -1 -1\nv 1 -1 -1\nv 1 -1 1\nv -1 -1 1\nv 0 -0.3 0\n"
      "f 1 2 3 4\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\nf 5 9 6\nf 6 9 7\nf 7 9 8\nf 8 9 5\n";
  std::vector<NamedEnvelope> envelopes = usual_envelopes();
  const Result<geometry::Envelope> own = geometry::Envelope::from_obj(dented);
  ASSERT_TRUE(own) << own.error().message;
  envelopes.push_back({"own", "own.obj", *own});
  const auto sphere = Sphere::read({write_png("a.png", 64, 32), "equirectangular", envelopes, 1}).value();
  const auto eye = [&](int envelope, const std::string& x, const std::string& y, const std::string& z) {
    return sphere->answer({"eye", {{"envelope", std::to_string(envelope)}, {"x", x}, {"y", y}, {"z", z}}});
  };
  const auto text = [](const Answer& answer) { return std::string(answer.body->begin(), answer.body->end()); };
  EXPECT_EQ(eye(0, "0.5", "-0.5", "0.5").status, 200U) << "0.87 from the centre of a sphere of radius 1";
  EXPECT_EQ(eye(0, "0.6", "-0.6", "0.6").status, 409U) << "1.04 from it";
  EXPECT_EQ(eye(6, "0", "0.5", "0").status, 200U);
  // Planes of the hollow's faces: through (0, -0.3, 0), with a slope of 0.7. At x, the kernel is above -0.3 + 0.7 x.
  EXPECT_EQ(eye(6, "0.1", "-0.2", "0").status, 200U);
  EXPECT_EQ(eye(6, "0.1", "-0.25", "0").status, 409U);
  const Answer hidden = eye(6, "0.95", "-0.8", "0");
  EXPECT_EQ(hidden.status, 409U);
  EXPECT_NE(text(hidden).find("face of line"), std::string::npos) << text(hidden);
  for (const char* wrong : {"nan", "inf", "1e7", "", "0,1"}) EXPECT_EQ(eye(0, wrong, "0", "0").status, 400U) << wrong;
  EXPECT_EQ(eye(7, "0", "0", "0").status, 400U);
  EXPECT_EQ(sphere->answer({"eye", {{"envelope", "0"}}}).status, 400U);
}

TEST_F(LookedAt, TheFileVanishes_NothingChanges) {
  const std::string png = write_png("a.png", 256, 128);
  const auto sphere = read(png, "equirectangular");
  const std::vector<std::uint8_t> bytes = test::read_bytes(png);
  std::filesystem::remove(png);
  EXPECT_EQ(*sphere->answer({"picture", {{"side", "256"}}}).body, bytes);
  EXPECT_GT(mesh_of(*sphere, 0).triangles.size(), 100u);
}

TEST_F(LookedAt, GraphicsThatTakeOnlySmallPictures_GetASmallerOne) {
  const auto sphere = read(write_png("a.png", 512, 256), "equirectangular");
  const Answer answer = sphere->answer({"picture", {{"side", "128"}}});
  EXPECT_EQ(answer.type, "image/jpeg");
  const DecodedImage picture = media::decode_image(*answer.body, "answer", PixelFormat::kRgb24).value();
  EXPECT_EQ(picture.width, 128);
  EXPECT_EQ(picture.height, 64);
}

TEST_F(LookedAt, EveryLayoutOfTheWholeSphere_HasTrianglesOnEveryEnvelope_WithinTheErrorThatIsTold) {
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
    if (!test::holds_whole_sphere(kind)) continue;
    const geometry::LayoutName name = geometry::LayoutName::parse(kind.name).value();
    const geometry::RaymapSize size = name.size_for_width(128);
    const auto sphere = read(write_png("a.png", size.width, size.height), std::string(kind.name));
    ASSERT_NE(sphere, nullptr) << kind.name;
    const mesh::Raymesh mesh = mesh_of(*sphere, 0);
    ASSERT_GE(mesh.triangles.size(), 8u) << kind.name;
    // The solid angle of all triangles (Van Oosterom and Strackee 1983) is that of a sphere.
    double whole = 0;
    for (const mesh::Raymesh::Triangle& t : mesh.triangles) {
      const Eigen::Vector3d a = mesh.point(t[0]).normalized(), b = mesh.point(t[1]).normalized(),
                            c = mesh.point(t[2]).normalized();
      whole += 2 * std::atan2(std::abs(a.dot(b.cross(c))), 1 + a.dot(b) + b.dot(c) + c.dot(a));
    }
    EXPECT_NEAR(whole, 4 * std::acos(-1.0), 0.01) << kind.name;
    EXPECT_LE(scene_of(*sphere)["error_deg"].get<double>(), 0.2) << kind.name;
  }
  const auto sphere = read(write_png("a.png", 128, 64), "equirectangular");
  for (int k = 0; k < 6; ++k) EXPECT_GT(mesh_of(*sphere, k).triangles.size(), 100u) << k;
}

TEST_F(LookedAt, AScatteredRaymap_IsInterpolated_AndTooManyRaysAreShownFlatWithTheReason) {
  const auto few = read(write_png("few.png", 128, 64), "hammersley");
  EXPECT_EQ(scene_of(*few)["flat"], "");
  ASSERT_EQ(few->notes().size(), 1u);
  EXPECT_NE(few->notes()[0].find("natural neighbours"), std::string::npos) << few->notes()[0];
  const auto many = read(write_png("many.png", 1024, 512), "hammersley");
  const std::string flat = scene_of(*many)["flat"];
  EXPECT_NE(flat.find("524288 rays"), std::string::npos) << flat;
  EXPECT_EQ(many->answer({"mesh.glb", {{"envelope", "0"}}}).status, 404u);
  EXPECT_EQ(many->answer({"picture", {{"side", "1024"}}}).status, 200u);
}

TEST_F(LookedAt, QuestionsThatMakeNoSense_AreRefusedInASentence) {
  const auto sphere = read(write_png("a.png", 128, 64), "equirectangular");
  const auto status = [&](const std::string& name, const std::map<std::string, std::string>& query) {
    return sphere->answer({name, query}).status;
  };
  for (const std::string side : {"", "0", "-5", "15", "32769", "4096x", "nan", "99999999999999"})
    EXPECT_EQ(status("picture", {{"side", side}}), 400u) << side;
  EXPECT_EQ(status("picture", {}), 400u);
  for (const std::string k : {"6", "-1", "nan", ""}) EXPECT_EQ(status("mesh.glb", {{"envelope", k}}), 400u) << k;
  EXPECT_EQ(status("../a.png", {}), 404u);
  EXPECT_EQ(status("", {}), 404u);
}

TEST_F(LookedAt, AFileThatIsNoRaymap_IsAnErrorWithItsName) {
  const std::string png = write_png("a.png", 128, 64);
  const auto unsaid = Sphere::read({png, "", usual_envelopes(), 1});
  ASSERT_FALSE(unsaid);
  EXPECT_NE(unsaid.error().message.find("say its layout: --from"), std::string::npos) << unsaid.error().message;
  const auto gone = Sphere::read({(folder_ / "gone.png").string(), "", usual_envelopes(), 1});
  ASSERT_FALSE(gone);
  EXPECT_NE(gone.error().message.find("gone.png"), std::string::npos);
}

TEST(Shrunk, EachPixel_IsTheMeanOfWhatItCovers) {
  const DecodedImage picture{PixelFormat::kGrey8, 4, 2, {0, 100, 50, 250, 100, 200, 150, 250}, {}, {}};
  EXPECT_EQ(shrunk(picture, 2).bytes, (std::vector<std::uint8_t>{100, 175}));
  EXPECT_EQ(shrunk(picture, 4).bytes, picture.bytes);
  const DecodedImage three{PixelFormat::kRgb24, 3, 1, {0, 0, 0, 90, 30, 60, 180, 0, 0}, {}, {}};
  // Two of three: each covers one and a half: (0 + 90 / 2) / 1.5 = 30, (90 / 2 + 180) / 1.5 = 150.
  EXPECT_EQ(shrunk(three, 2).bytes, (std::vector<std::uint8_t>{30, 10, 20, 150, 10, 20}));
}

}  // namespace
}  // namespace nodal::host::look
