#include "protocol/calibration.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <cmath>
#include <nlohmann/json.hpp>

#include "examples.h"

namespace nodal {
namespace {

double between(double low, double high) {
  // Full mantissas, to test the shortest-digits output.
  const double part = static_cast<double>(*rc::gen::arbitrary<std::uint32_t>()) / 4294967296.0;
  return low + (high - low) * std::sqrt(part);
}

std::array<double, 9> any_rotation() {
  const double y = between(-3, 3), p = between(-1.5, 1.5), r = between(-3, 3);
  const double cy = std::cos(y), sy = std::sin(y), cp = std::cos(p), sp = std::sin(p), cr = std::cos(r),
               sr = std::sin(r);
  return {cy * cr + sy * sp * sr,
          cp * sr,
          -sy * cr + cy * sp * sr,
          -cy * sr + sy * sp * cr,
          cp * cr,
          sy * sr + cy * sp * cr,
          sy * cp,
          -sp,
          cy * cp};
}

LensModel any_lens() {
  switch (*rc::gen::inRange(0, 4)) {
    case 0: return TsaiLens{between(300, 900), between(0, 3e-6), between(0, 3e-11)};
    case 1: return RectilinearLens{{between(300, 900), 0, between(0, 20)}};
    case 2: return EquidistantLens{{between(300, 900), between(-10, 10), between(0, 20)}};
    default: return KannalaBrandtLens{between(300, 900), {between(0, 0.1), between(0, 0.01), 0, 0}};
  }
}

Response any_response() {
  Response response;
  response.curve = static_cast<Response::Curve>(*rc::gen::inRange(0, 4));
  if (response.curve == Response::Curve::kGamma) response.gamma = between(0.5, 3);
  if (response.curve == Response::Curve::kPolynomial) {
    const double c1 = between(0.1, 0.9);
    response.coefficients = {c1, 1 - c1};
  }
  return response;
}

HeadCalibration any_head(int index) {
  HeadCalibration head;
  head.name = "head-" + std::to_string(index) + *rc::gen::element<std::string>("", ".a", "_B");
  head.width = *rc::gen::inRange(64, 4000);
  head.height = *rc::gen::inRange(64, 3000);
  head.center_x = between(0.4, 0.6) * head.width;
  head.center_y = between(0.4, 0.6) * head.height;
  head.aspect = between(0.8, 1.2);
  head.lens = any_lens();
  head.max_angle = between(0.1, 1.0);
  head.R_head_rig = any_rotation();
  head.region = {between(0, 3), between(0, 3), head.width - between(0, 3), head.height - between(0, 3), {}};
  if (*rc::gen::arbitrary<bool>()) head.region.circle = Region::Circle{head.center_x, head.center_y, between(30, 3000)};
  head.response = any_response();
  head.vignetting = {between(0, head.width), between(0, head.height), 6000, {between(-0.3, 0), between(-0.1, 0.1), 0}};
  head.gain = {between(0.5, 2), between(0.5, 2), between(0.5, 2)};
  return head;
}

Calibration any_calibration() {
  Calibration calibration{*rc::gen::element<std::string>("rig", "\"q\" \\", "é"),
                          *rc::gen::element<std::string>("", "two\nlines", "ü \t"),
                          {}};
  const int count = *rc::gen::inRange(1, 17);
  for (int i = 0; i < count; ++i) calibration.heads.push_back(any_head(i));
  return calibration;
}

RC_GTEST_PROP(Calibration, WrittenAndReadAgain_IsTheSameToTheBit, ()) {
  const Calibration calibration = any_calibration();
  for (const std::string& text : {to_json(calibration), canonical_json(calibration)}) {
    const Result<Calibration> again = parse_calibration(text);
    if (!again) RC_FAIL(again.error().text() + "\n" + text);
    RC_ASSERT(*again == calibration);
    RC_ASSERT(calibration_id(*again) == calibration_id(calibration));
  }
}

RC_GTEST_PROP(Calibration, CanonicalForm_HasSortedKeysAndNoWhiteSpaceOutsideStrings, ()) {
  const std::string text = canonical_json(any_calibration());
  // nlohmann's json keeps keys sorted; only its number format differs, so compare trees and key order.
  RC_ASSERT(nlohmann::ordered_json::parse(text).dump() == nlohmann::json::parse(text).dump());
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '"') in_string = !in_string;
    if (text[i] == '\\') ++i;  // an escaped character does not end the string
    RC_ASSERT(in_string || (text[i] != ' ' && text[i] != '\n'));
  }
}

TEST(Calibration, CanonicalForm_IsFixedForever) {
  // Uploads, takes and tables are named by this text's SHA-256, so it must never change within a version.
  Calibration calibration{"r", "", {figure3_head()}};
  calibration.heads[0].response = {Response::Curve::kGamma, 2.2, {}};
  EXPECT_EQ(
      canonical_json(calibration),
      R"({"comment":"","heads":[{"R_head_rig":[[1,0,0],[0,1,0],[0,0,1]],"aspect":1.083,"center":[360.8,224.6],)"
      R"("gain":{"blue":0.95,"green":1,"red":1.05},"height":480,"lens":{"focal":490,"kappa1":2.29e-06,)"
      R"("kappa2":1.65e-11,"model":"tsai"},"max_angle":0,"name":"cam5","region":{"bottom":480,"left":0,)"
      R"("right":720,"top":0},"response":{"curve":"gamma","gamma":2.2},"vignetting":{"coefficients":[-0.2,-0.08,0],)"
      R"("radius":423,"x":360.8,"y":224.6},"width":720}],"name":"r","nodal_calibration":1})");
  // sha256sum of the text above.
  EXPECT_EQ(to_hex(calibration_id(calibration)), "eafe84027278344889854b67870fbfdbac86bc08a1dfeb2dab7a98706bbd0d97");
}

TEST(Calibration, ReadFromTextWrittenInAnotherOrder_HasTheSameId) {
  const Calibration calibration = two_heads();
  const std::string other = nlohmann::json::parse(to_json(calibration)).dump(7);  // sorted keys, deep indent
  ASSERT_NE(other, to_json(calibration));
  const Result<Calibration> read = parse_calibration(other);
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(calibration_id(*read), calibration_id(calibration));
}

TEST(Calibration, OneDigitChanged_ChangesTheId) {
  const Calibration calibration = two_heads();
  Calibration other = calibration;
  other.heads[1].gain[2] = std::nextafter(other.heads[1].gain[2], 2);
  EXPECT_NE(calibration_id(other), calibration_id(calibration));
}

TEST(Calibration, RotationWrittenWithSevenDigits_IsMadeOrthonormalOnceAndForAll) {
  Calibration calibration = two_heads();
  calibration.heads[0].R_head_rig = {0.3078362, 0.1755233, -0.9351088, 0.9375922, 0.1111067,
                                     0.3295089, 0.1617333, -0.9781855, -0.1303667};
  const Result<Calibration> read = parse_calibration(to_json(calibration));
  ASSERT_TRUE(read) << read.error().text();
  const auto& R = read->heads[0].R_head_rig;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      double dot = 0;
      for (std::size_t k = 0; k < 3; ++k) dot += R[3 * i + k] * R[3 * j + k];
      EXPECT_NEAR(dot, i == j ? 1 : 0, 1e-14);
      EXPECT_NEAR(R[3 * i + j], calibration.heads[0].R_head_rig[3 * i + j], 2e-7);
    }
  }
  const Result<Calibration> again = parse_calibration(to_json(*read));
  ASSERT_TRUE(again);
  EXPECT_EQ(*again, *read);
}

TEST(Calibration, ForPeople_HasTheFieldsInTheDocumentsOrderAndRowsOnTheirLines) {
  const std::string text = to_json(two_heads());
  EXPECT_EQ(text.find("{\n  \"nodal_calibration\": 1,\n  \"name\": \"test rig\","), 0u) << text;
  EXPECT_NE(text.find("\"center\": [360.8, 224.6],\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\"lens\": {\"model\": \"tsai\", \"focal\": 490, \"kappa1\": 2.29e-06, \"kappa2\": 1.65e-11},\n"),
            std::string::npos)
      << text;
}

}  // namespace
}  // namespace nodal
