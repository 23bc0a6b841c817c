#include "stitch/media/xmp/xmp.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace nodal::media {
namespace {

constexpr const char* kOpen =
    "<?xpacket begin=\"\xef\xbb\xbf\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?><x:xmpmeta xmlns:x=\"adobe:ns:meta/\">"
    "<rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">";
constexpr const char* kShut = "</rdf:RDF></x:xmpmeta><?xpacket end=\"w\"?>";
constexpr const char* kSpace = "http://ns.google.com/photos/1.0/panorama/";

std::string packet(const std::string& inside) { return kOpen + inside + kShut; }

std::string value_of(const XmpWords& words, const std::string& name) {
  const auto at = std::ranges::find(words.kept, name, &XmpProperty::name);
  return at == words.kept.end() ? "" : at->value;
}

TEST(Xmp, WhatIsWritten_IsRead) {
  const XmpWords words = parse_xmp(gpano_packet(400, 200,
                                                {{"GPano:PoseHeadingDegrees", "225.5"},
                                                 {"GPano:CaptureSoftware", "a \"b\" <c> & d"},
                                                 {"exif:GPSLatitude", "52,30.5N"}}));
  ASSERT_TRUE(words.area);
  EXPECT_EQ(words.area->full_width, 400);
  EXPECT_EQ(words.area->height, 200);
  EXPECT_EQ(value_of(words, "GPano:PoseHeadingDegrees"), "225.5");
  EXPECT_EQ(value_of(words, "GPano:CaptureSoftware"), "a \"b\" <c> & d");
  EXPECT_EQ(value_of(words, "exif:GPSLatitude"), "52,30.5N");
  EXPECT_EQ(words.kept.size(), 3U) << "what describes the file's own pixels is not kept";
}

TEST(Xmp, EveryWayToWriteAProperty_SaysTheSame) {
  const std::string space = std::string(" xmlns:GPano='") + kSpace + "'";
  for (const std::string& inside :
       {// Attributes in either quotes, with spaces and lines around the signs.
        "<rdf:Description rdf:about=''" + space +
            " GPano:ProjectionType = 'equirectangular'\n GPano:FullPanoWidthPixels\n=\n\"256\" "
            "GPano:PosePitchDegrees='-24.5'/>",
        // Elements, with white space in them.
        "<rdf:Description" + space + "><GPano:ProjectionType>\n equirectangular\n</GPano:ProjectionType>" +
            "<GPano:FullPanoWidthPixels> +256.0 </GPano:FullPanoWidthPixels>" +
            "<GPano:PosePitchDegrees>-24.5</GPano:PosePitchDegrees></rdf:Description>",
        // Another prefix, and numbers as entities.
        std::string("<rdf:Description xmlns:p=\"") + kSpace + "\" p:ProjectionType=\"equirectangular\" " +
            "p:FullPanoWidthPixels=\"&#50;56\" p:PosePitchDegrees=\"-24.5\"/>",
        // Spread over several descriptions, the namespace declared above, a comment between.
        "<rdf:Description" + space +
            " GPano:ProjectionType=\"equirectangular\"/><!-- GPano:FullPanoWidthPixels=\"9\" -->" + "<rdf:Description" +
            space + "><GPano:FullPanoWidthPixels>256</GPano:FullPanoWidthPixels>" +
            "<GPano:PosePitchDegrees>-24.5</GPano:PosePitchDegrees></rdf:Description>"}) {
    const XmpWords words = parse_xmp(packet(inside));
    ASSERT_TRUE(words.area) << inside;
    EXPECT_EQ(words.area->full_width, 256) << inside;
    EXPECT_EQ(value_of(words, "GPano:PosePitchDegrees"), "-24.5") << inside;
  }
}

TEST(Xmp, OtherNamespacesAndNumbersThatAreNone_SayNothing) {
  const XmpWords words = parse_xmp(
      packet(std::string("<rdf:Description xmlns:GPano=\"http://example.org/\" xmlns:G=\"") + kSpace +
             "\" GPano:ProjectionType=\"equirectangular\" G:PoseHeadingDegrees=\"nan\" G:PoseRollDegrees=\"400\" "
             "G:PosePitchDegrees=\"12deg\"/>"));
  EXPECT_FALSE(words.area);
  EXPECT_TRUE(words.kept.empty());
  EXPECT_FALSE(
      parse_xmp(packet(std::string("<rdf:Description xmlns:G=\"") + kSpace + "\" G:ProjectionType=\"cylindrical\"/>"))
          .area);
  EXPECT_FALSE(parse_xmp("").area);
}

TEST(Xmp, BrokenAndDeepPackets_AreReadAsFarAsTheyGo) {
  const std::string whole = gpano_packet(400, 200, {{"GPano:PoseHeadingDegrees", "1"}});
  for (std::size_t length = 0; length < whole.size(); length += 7) parse_xmp(whole.substr(0, length));
  std::string deep;
  for (int k = 0; k < 100'000; ++k) deep += "<a>";
  EXPECT_FALSE(parse_xmp(packet(deep)).area);
  // Beyond the limit of a packet nothing is read.
  EXPECT_FALSE(parse_xmp(std::string(kMaxXmpBytes, ' ') + whole).area);
}

}  // namespace
}  // namespace nodal::media
