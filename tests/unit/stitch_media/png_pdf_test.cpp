#include "stitch/media/pdf_page.h"
#include "stitch/media/png_writer.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <string>

#include "stitch/media/image_file.h"

namespace nodal::media {
namespace {

struct Picture {
  std::vector<std::uint8_t> values;
  GreyRaster raster() const { return {40, 30, values}; }
};

Picture grey_picture() {
  Picture p;
  for (int i = 0; i < 40 * 30; ++i) p.values.push_back(static_cast<std::uint8_t>(i * 37 % 251));
  return p;
}

TEST(PngFile, GreyPicture_IsReadBackAsItWas) {
  const Picture p = grey_picture();
  const auto png = png_file({40, 30, 1, 8, p.values}, {SampleMeaning::srgb(), 10000, "a comment", {}, 6});
  ASSERT_TRUE(png) << png.error().text();
  const auto read = decode_image(*png, "p.png", PixelFormat::kGrey8);
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(read->width, 40);
  EXPECT_EQ(read->height, 30);
  EXPECT_EQ(read->bytes, p.values);
}

TEST(GreyPdf, TableAndPicture_AreWhereItSaysTheyAre) {
  const Picture p = grey_picture();
  const auto bytes = grey_pdf(p.raster(), 420, 297, 10, "made (by) hand");
  ASSERT_TRUE(bytes) << bytes.error().text();
  const std::string pdf(bytes->begin(), bytes->end());
  ASSERT_TRUE(pdf.starts_with("%PDF-1.4\n"));
  ASSERT_TRUE(pdf.ends_with("%%EOF\n"));
  // ISO 32000-1, 7.5.4: each entry of the table is the offset of "N 0 obj".
  const std::size_t startxref = pdf.rfind("startxref\n");
  const std::size_t table = std::stoul(pdf.substr(startxref + 10));
  ASSERT_EQ(pdf.substr(table, 5), "xref\n");
  std::size_t at = pdf.find('\n', table + 5) + 1;
  EXPECT_EQ(pdf.substr(at, 20), "0000000000 65535 f \n");
  for (int object = 1; object <= 5; ++object) {
    const std::size_t offset = std::stoul(pdf.substr(at + 20 * static_cast<std::size_t>(object), 10));
    EXPECT_EQ(pdf.substr(offset, 7), std::to_string(object) + " 0 obj");
  }
  EXPECT_NE(pdf.find("made \\(by\\) hand"), std::string::npos);
  // A3 is 1190.55 x 841.89 points.
  EXPECT_NE(pdf.find("/MediaBox [0 0 1190.5512 841.8898]"), std::string::npos);

  const std::size_t image = pdf.find("/Subtype /Image");
  const std::size_t length = std::stoul(pdf.substr(pdf.find("/Length ", image) + 8));
  const std::size_t begin = pdf.find("stream\n", image) + 7;
  std::vector<std::uint8_t> values(40 * 30);
  uLongf size = values.size();
  ASSERT_EQ(uncompress(values.data(), &size, bytes->data() + begin, length), Z_OK);
  EXPECT_EQ(values, p.values);
}

TEST(GreyPdf, MarginsWithoutRoom_AreRefused) {
  const Picture p = grey_picture();
  const auto refused = grey_pdf(p.raster(), 100, 100, 48, "");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadValue);
}

}  // namespace
}  // namespace nodal::media
