// Every error of a document gives one message that names the head and the field and says how to correct it.
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "examples.h"
#include "protocol/calibration.h"

namespace nodal {
namespace {

struct BadText {
  const char* name;
  std::function<std::string(std::string)> spoil;
  Errc code;
  std::vector<const char*> says;
  friend void PrintTo(const BadText& bad, std::ostream* out) { *out << bad.name; }
};

std::function<std::string(std::string)> swap(std::string from, std::string to) {
  return [=](const std::string& text) { return replaced(text, from, to); };
}

const auto kByName = [](const auto& bad) { return std::string(bad.param.name); };

class ParseRefuses : public testing::TestWithParam<BadText> {};

TEST_P(ParseRefuses, NamingHeadAndField) {
  const Result<Calibration> read = parse_calibration(GetParam().spoil(to_json(two_heads())));
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, GetParam().code) << read.error().text();
  for (const char* words : GetParam().says) {
    EXPECT_NE(read.error().message.find(words), std::string::npos) << words << " is not in: " << read.error().text();
  }
}

INSTANTIATE_TEST_SUITE_P(
    Texts, ParseRefuses,
    testing::Values(
        BadText{"NotACalibration",
                [](auto) { return "{\"cameras\": []}"; },
                Errc::kBadFormat,
                {"not a Nodal calibration", "import"}},
        BadText{"AList", [](auto) { return "[]"; }, Errc::kBadFormat, {"not a Nodal calibration"}},
        BadText{"Cut",
                [](const std::string& whole) { return whole.substr(0, whole.size() / 2); },
                Errc::kTruncated,
                {"line"}},
        BadText{"Future",
                swap("\"nodal_calibration\": 1", "\"nodal_calibration\": 4, \"new\": 1"),
                Errc::kFutureVersion,
                {"version 4", "reads up to 3", "update Nodal"}},
        BadText{"NameWithALineBreakAndEscape",
                swap("\"name\": \"test rig\"", "\"name\": \"r\\nforged\\u001b[2J\""),
                Errc::kBadValue,
                {"name", "control character"}},
        BadText{"NameWithAC1Control",
                swap("\"name\": \"test rig\"", "\"name\": \"r\\u009b2J\""),
                Errc::kBadValue,
                {"name", "control character"}},
        BadText{"NameWithABidirectionalOverride",
                swap("\"name\": \"test rig\"", "\"name\": \"r\\u202egnp\""),
                Errc::kBadValue,
                {"name", "bidirectional"}},
        BadText{"VersionText",
                swap("\"nodal_calibration\": 1", "\"nodal_calibration\": \"1\""),
                Errc::kBadValue,
                {"nodal_calibration"}},
        BadText{"VersionZero",
                swap("\"nodal_calibration\": 1", "\"nodal_calibration\": 0"),
                Errc::kBadValue,
                {"nodal_calibration"}},
        BadText{"Unknown",
                swap("\"aspect\"", "\"aspekt\": 1, \"aspect\""),
                Errc::kUnknownField,
                {"head 'cam5'", "'aspekt'", "'aspect'"}},
        BadText{
            "UnknownAtTop", swap("\"comment\"", "\"coment\": \"\", \"comment\""), Errc::kUnknownField, {"'coment'"}},
        BadText{"UnknownDeep",
                swap("\"kappa1\"", "\"kappa3\": 0, \"kappa1\""),
                Errc::kUnknownField,
                {"head 'cam5': lens", "'kappa3'"}},
        BadText{"Missing", swap("\"width\": 720,", ""), Errc::kMissingField, {"head 'cam5'", "'width' is missing"}},
        BadText{"MissingHeads", swap("\"heads\"", "\"haeds\""), Errc::kMissingField, {"'heads' is missing"}},
        BadText{"MissingDeep", swap("\"focal\": 490, ", ""), Errc::kMissingField, {"head 'cam5': lens", "'focal'"}},
        BadText{"DuplicateKey",
                swap("\"width\": 720,", "\"width\": 720, \"width\": 721,"),
                Errc::kBadFormat,
                {"'width' is given twice"}},
        BadText{"TextForNumber",
                swap("\"aspect\": 1.083", "\"aspect\": \"1.083\""),
                Errc::kBadValue,
                {"head 'cam5'", "aspect must be a number"}},
        BadText{"NullForNumber",
                swap("\"aspect\": 1.083", "\"aspect\": null"),
                Errc::kBadValue,
                {"aspect must be a number"}},
        BadText{"NumberForObject",
                swap("\"gain\": {\"red\": 1.05, \"green\": 1, \"blue\": 0.95}", "\"gain\": 1"),
                Errc::kBadValue,
                {"head 'cam5': gain", "must be an object"}},
        BadText{"HalfAPixel",
                swap("\"width\": 720", "\"width\": 720.5"),
                Errc::kBadValue,
                {"width must be a whole number"}},
        BadText{
            "HugeWidth", swap("\"width\": 720", "\"width\": 1e300"), Errc::kBadValue, {"width must be a whole number"}},
        BadText{"NaN", swap("\"aspect\": 1.083", "\"aspect\": NaN"), Errc::kBadFormat, {"NaN", "line 11"}},
        BadText{"Overflow", swap("\"aspect\": 1.083", "\"aspect\": 1e999"), Errc::kBadFormat, {"too large", "line 11"}},
        BadText{
            "ShortCenter", swap("[360.8, 224.6]", "[360.8]"), Errc::kBadValue, {"center must be a list of 2 numbers"}},
        BadText{"TwoRows",
                swap("[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", "[[1, 0, 0], [0, 1, 0]]"),
                Errc::kBadValue,
                {"head 'cam5'", "R_head_rig must be three rows"}},
        BadText{"Lens",
                swap("\"tsai\"", "\"thin\""),
                Errc::kUnsupported,
                {"head 'cam5': lens", "'thin'", "kannala_brandt"}},
        BadText{"Curve", swap("\"linear\"", "\"log\""), Errc::kUnsupported, {"head 'cam5': response", "'log'", "srgb"}},
        BadText{"NoHeads",
                [](auto) { return R"({"nodal_calibration": 1, "name": "", "comment": "", "heads": []})"; },
                Errc::kBadValue,
                {"0 heads", "1 to 64"}},
        BadText{"HeadIsANumber",
                [](auto) { return R"({"nodal_calibration": 1, "name": "", "comment": "", "heads": [7]})"; },
                Errc::kBadValue,
                {"heads[0]", "must be an object"}}),
    kByName);

struct BadValue {
  const char* name;
  std::function<void(Calibration&)> spoil;
  Errc code;
  std::vector<const char*> says;
  friend void PrintTo(const BadValue& bad, std::ostream* out) { *out << bad.name; }
};

class CheckRefuses : public testing::TestWithParam<BadValue> {};

TEST_P(CheckRefuses, NamingHeadAndField) {
  Calibration calibration = two_heads();
  ASSERT_TRUE(check_calibration(calibration)) << check_calibration(calibration).error().text();
  GetParam().spoil(calibration);
  const Status checked = check_calibration(calibration);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().code, GetParam().code) << checked.error().text();
  for (const char* words : GetParam().says) {
    EXPECT_NE(checked.error().message.find(words), std::string::npos)
        << words << " is not in: " << checked.error().text();
  }
}

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

BadValue in_head(const char* name, std::function<void(HeadCalibration&)> spoil, Errc code,
                 std::vector<const char*> says) {
  says.push_back("head 'cam5'");
  return {name, [=](Calibration& c) { spoil(c.heads[0]); }, code, says};
}

INSTANTIATE_TEST_SUITE_P(
    Rigs, CheckRefuses,
    testing::Values(
        BadValue{"NoHead", [](Calibration& c) { c.heads.clear(); }, Errc::kBadValue, {"0 heads"}},
        BadValue{
            "SixtyFiveHeads", [](Calibration& c) { c.heads.resize(65, c.heads[0]); }, Errc::kBadValue, {"65 heads"}},
        BadValue{"SameName",
                 [](Calibration& c) { c.heads[1].name = "cam5"; },
                 Errc::kBadValue,
                 {"heads[0]", "heads[1]", "'cam5'", "name of its own"}},
        BadValue{"NoName", [](Calibration& c) { c.heads[1].name.clear(); }, Errc::kBadValue, {"heads[1]", "name"}},
        BadValue{"NameWithNewline",
                 [](Calibration& c) { c.heads[1].name = "a\nb"; },
                 Errc::kBadValue,
                 {"heads[1]", "A-Z a-z"}},
        BadValue{"LongComment", [](Calibration& c) { c.comment.assign(70000, 'x'); }, Errc::kTooLarge, {"65536"}}),
    kByName);

INSTANTIATE_TEST_SUITE_P(
    Heads, CheckRefuses,
    testing::Values(
        in_head("ZeroWidth", [](auto& h) { h.width = 0; }, Errc::kBadValue, {"width is 0"}),
        in_head("HugeHeight", [](auto& h) { h.height = 40000; }, Errc::kBadValue, {"height is 40000"}),
        in_head("NaNCenter", [](auto& h) { h.center_x = kNaN; }, Errc::kBadValue, {"center[0] is nan"}),
        in_head("InfiniteAspect", [](auto& h) { h.aspect = kInfinity; }, Errc::kBadValue, {"aspect is inf"}),
        in_head("NegativeAspect", [](auto& h) { h.aspect = -1; }, Errc::kBadValue, {"aspect is -1"}),
        in_head("ZeroFocal",
                [](auto& h) {
                  h.lens = TsaiLens{0, 0, 0};
                },
                Errc::kBadValue, {"lens.focal is 0"}),
        in_head("NaNKappa",
                [](auto& h) {
                  h.lens = TsaiLens{490, kNaN, 0};
                },
                Errc::kBadValue, {"lens.kappa1"}),
        in_head("NoCoefficients", [](auto& h) { h.lens = EquidistantLens{}; }, Errc::kBadValue,
                {"lens.coefficients has 0"}),
        in_head("TenCoefficients", [](auto& h) { h.lens = EquidistantLens{std::vector<double>(10, 1.0)}; },
                Errc::kBadValue, {"lens.coefficients has 10"}),
        in_head("FallingLens", [](auto& h) { h.lens = RectilinearLens{{-300}}; }, Errc::kBadValue,
                {"lens.coefficients[0]"}),
        in_head("NaNK",
                [](auto& h) {
                  h.lens = KannalaBrandtLens{300, {0, kNaN, 0, 0}};
                },
                Errc::kBadValue, {"lens.k[1]"}),
        in_head("TurnsInsideThePicture",
                [](auto& h) {
                  h.lens = TsaiLens{490, -3e-6, 0};
                },
                Errc::kLensDomain, {"has its largest radius", "333.333 px", "set max_angle"}),
        in_head("TurnsAtOnce",
                [](auto& h) {
                  h.lens = TsaiLens{490, -1, 0};
                },
                Errc::kLensDomain, {"within a pixel"}),
        in_head("AngleBeyondTurn",
                [](auto& h) {
                  h.lens = EquidistantLens{{300, -50}};
                  h.max_angle = 3.1;
                },
                Errc::kLensDomain,
                {"max_angle is 177.617 degrees", "has its largest radius at 171.887 degrees", "at most 3 rad"}),
        in_head("AngleBehindAPinhole", [](auto& h) { h.max_angle = 1.6; }, Errc::kLensDomain,
                {"ends at 89.99 degrees"}),
        in_head("NegativeAngle", [](auto& h) { h.max_angle = -0.1; }, Errc::kBadValue, {"max_angle"}),
        in_head("NaNAngle", [](auto& h) { h.max_angle = kNaN; }, Errc::kBadValue, {"max_angle"}),
        in_head("Reflection", [](auto& h) { h.R_head_rig = {-1, 0, 0, 0, 1, 0, 0, 0, 1}; }, Errc::kNotARotation,
                {"reflection", "one axis points the wrong way"}),
        in_head("SwappedAxes", [](auto& h) { h.R_head_rig = {0, 1, 0, 1, 0, 0, 0, 0, 1}; }, Errc::kNotARotation,
                {"reflection"}),
        in_head("Scaled", [](auto& h) { h.R_head_rig = {2, 0, 0, 0, 2, 0, 0, 0, 2}; }, Errc::kNotARotation,
                {"not a rotation", "off being perpendicular and of length 1 by 3"}),
        in_head("Sheared", [](auto& h) { h.R_head_rig = {1, 0.001, 0, 0, 1, 0, 0, 0, 1}; }, Errc::kNotARotation,
                {"0.001", "shear"}),
        in_head("ZeroMatrix", [](auto& h) { h.R_head_rig = {}; }, Errc::kNotARotation, {"not a rotation"}),
        in_head("NaNMatrix", [](auto& h) { h.R_head_rig[4] = kNaN; }, Errc::kBadValue, {"R_head_rig"}),
        in_head("RegionOutside", [](auto& h) { h.region.right = 721; }, Errc::kBadValue, {"region", "720x480"}),
        in_head("RegionEmpty", [](auto& h) { h.region.right = h.region.left; }, Errc::kBadValue, {"region is empty"}),
        in_head("RegionNaN", [](auto& h) { h.region.top = kNaN; }, Errc::kBadValue, {"region"}),
        in_head("CircleElsewhere",
                [](auto& h) {
                  h.region.circle = Region::Circle{2000, 200, 100};
                },
                Errc::kBadValue, {"region.circle", "nothing of the picture is left"}),
        in_head("CircleOfNothing",
                [](auto& h) {
                  h.region.circle = Region::Circle{360, 200, 0};
                },
                Errc::kBadValue, {"region.circle.radius is 0"}),
        in_head("ZeroGamma",
                [](auto& h) {
                  h.response = {Response::Curve::kGamma, 0, {}};
                },
                Errc::kBadValue, {"response.gamma is 0"}),
        in_head("ResponseSum",
                [](auto& h) {
                  h.response = {Response::Curve::kPolynomial, 1, {0.5, 0.4}};
                },
                Errc::kBadValue, {"response.coefficients sum to 0.9"}),
        in_head("ResponseFalls",
                [](auto& h) {
                  h.response = {Response::Curve::kPolynomial, 1, {3, -2}};
                },
                Errc::kBadValue, {"stop rising at an encoded value of 0.75"}),
        in_head("Vignetted",
                [](auto& h) {
                  h.vignetting.coefficients = {-1.2, 0, 0};
                },
                Errc::kBadValue, {"vignetting falls to -"}),
        in_head("VignettingRadius", [](auto& h) { h.vignetting.radius = 0; }, Errc::kBadValue,
                {"vignetting.radius is 0"}),
        in_head("ZeroGain", [](auto& h) { h.gain[1] = 0; }, Errc::kBadValue, {"gain.green is 0"}),
        in_head("NaNGain", [](auto& h) { h.gain[2] = kNaN; }, Errc::kBadValue, {"gain.blue is nan"})),
    kByName);

TEST(CalibrationCheck, VignettingThatGoesDarkBeyondMaxAngle_IsAccepted) {
  HeadCalibration head = fisheye_head();
  head.region.circle.reset();
  // Zero at 1.3 radii = 978 px; the corners are 1075 px away, but 1.7 rad end at 733 px.
  head.vignetting.coefficients = {-1 / (1.3 * 1.3), 0, 0};
  EXPECT_TRUE(check_head(head)) << check_head(head).error().text();
  head.max_angle = 0;
  EXPECT_FALSE(check_head(head));
}

TEST(CalibrationCheck, EveryPrefixOfADocument_IsRefusedWithoutHarm) {
  const std::string text = to_json(two_heads());
  const std::size_t closing = text.rfind('}');
  for (std::size_t length = 0; length <= closing; length += 3) {
    EXPECT_FALSE(parse_calibration(text.substr(0, length))) << length;
  }
}

}  // namespace
}  // namespace nodal
