// Masks beside pictures and in their alpha channels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "stitch/media/image_file.h"
#include "stitch_command.h"

namespace nodal::command_line {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Shape = std::function<bool(int x, int y)>;

constexpr int kFine = 400;

/// A hand before the lens: stripes of pink.
Bytes with_hand(Bytes rgb, int side, const Shape& where) {
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      if (!where(x, y)) continue;
      const std::array<std::uint8_t, 3> pink{255, static_cast<std::uint8_t>(x / 5 % 2 == y / 7 % 2 ? 0 : 60), 255};
      std::ranges::copy(pink, rgb.begin() + 3 * (std::ptrdiff_t{side} * y + x));
    }
  }
  return rgb;
}

Bytes mask_of(int side, const Shape& hidden, std::uint8_t white = 255) {
  Bytes grey;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) grey.push_back(hidden(x, y) ? 0 : white);
  }
  return grey;
}

/// Share of pink pixels.
double pink(const DecodedImage& sphere) {
  double count = 0;
  for (std::size_t k = 0; k < sphere.bytes.size(); k += 3)
    count += sphere.bytes[k] > 180 && sphere.bytes[k + 1] < 110 && sphere.bytes[k + 2] > 180 ? 1 : 0;
  return 3 * count / static_cast<double>(sphere.bytes.size());
}

bool is_hand(int x, int y) { return std::hypot(x - 110, y - 80) < 22; }

class Masked : public StitchCommand {
 protected:
  void write_hand(std::size_t head, int channels) const {
    const Bytes rgb = with_hand(town().bytes[head], kSide, is_hand);
    Bytes pixels = rgb;
    if (channels == 4) {
      pixels.clear();
      const Bytes alpha = mask_of(kSide, is_hand);
      for (std::size_t k = 0; k < alpha.size(); ++k)
        pixels.insert(pixels.end(), {rgb[3 * k], rgb[3 * k + 1], rgb[3 * k + 2], alpha[k]});
    }
    test::write_bytes(path("pictures/" + name_of(head) + ".png"), test::png_of(pixels, kSide, kSide, channels));
  }
  void write_mask(const std::string& file, const Bytes& grey, int side) const {
    test::write_bytes(path(file), test::png_of(grey, side, side, 1));
  }
  DecodedImage stitched(const Words& words, const std::string& note = "") {
    Words all{"stitch"};
    all.insert(all.end(), words.begin(), words.end());
    all.insert(all.end(), {"--overwrite", "-o", path("sphere.png")});
    const Finished run = nodal(all);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.err.find(note), std::string::npos) << run.err;
    return media::read_image(path("sphere.png"), PixelFormat::kRgb24).value();
  }
};

TEST_F(Masked, WhatAMaskOrAlphaHides_IsTakenFromOtherPictures) {
  write_pictures("pictures");
  for (const char* blend : {"best", "board"}) {
    const Words words{path("rig.json"), path("pictures"), "--blend", blend};
    std::filesystem::remove(path("pictures/" + name_of(0) + ".mask.png"));
    test::write_bytes(path("pictures/" + name_of(0) + ".png"), test::png_of(town().bytes[0], kSide, kSide, 3));
    const DecodedImage clean = stitched(words);
    write_hand(0, 3);
    EXPECT_GT(pink(stitched(words)), 0.001) << blend;
    // Grey below half is hidden, too.
    write_mask("pictures/" + name_of(0) + ".mask.png", mask_of(kSide, is_hand, 140), kSide);
    const DecodedImage masked = stitched(words, "masks hide 5.9 % of head '" + name_of(0) + "'");
    EXPECT_EQ(pink(masked), 0) << blend;
    EXPECT_GT(test::psnr(masked.bytes, clean.bytes), 24) << blend;
    std::filesystem::remove(path("pictures/" + name_of(0) + ".mask.png"));
    write_hand(0, 4);
    EXPECT_EQ(stitched(words, "the alpha channel of " + name_of(0) + ".png").bytes, masked.bytes) << blend;
  }
}

TEST_F(Masked, PicturesAlone_ArePlacedByWhatTheMasksLeaveAndTheCalibrationHasThem) {
  const test::RenderedRig rig =
      test::render_rig(test::six_fisheyes(kFine), hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 1.0, 5, 2});
  const Shape board = [](int x, int y) { return std::abs(x - 200) < 90 && y > 230; };  // held by the one who films
  std::filesystem::create_directories(path("own"));
  for (std::size_t h = 0; h < rig.bytes.size(); ++h) {
    const std::string name = path("own/" + name_of(h));
    test::write_bytes(name + ".png", test::png_of(with_hand(rig.bytes[h], kFine, board), kFine, kFine, 3));
    write_mask("own/" + name_of(h) + ".mask.png", mask_of(kFine, board), kFine);
  }
  Words files;
  for (const auto& entry : std::filesystem::directory_iterator(path("own"))) files.push_back(entry.path().string());
  ASSERT_EQ(files.size(), 12U) << "as a shell lists *.png";
  std::ranges::sort(files);
  files.insert(files.begin(), "stitch");
  files.insert(files.end(), {"--width", "512", "-o", path("town.png")});
  const Finished run = nodal(files);
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.out.find("6 of 6 pictures placed"), std::string::npos) << run.out;
  const auto found = parse_calibration(read("town.rig.json"));
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_LT(test::rotation_error(rig.truth, *found).max_deg, 0.5);
  EXPECT_FALSE(found->heads[5].region.masks.empty());
  EXPECT_EQ(pink(media::read_image(path("town.png"), PixelFormat::kRgb24).value()), 0);
  ASSERT_EQ(nodal({"register", path("town.rig.json"), path("own"), "-o", path("again.json")}).code, 0);
}

TEST_F(Masked, MasksThatDoNotFit_AreRefusedByName) {
  write_pictures("pictures");
  const std::string mask = "pictures/" + name_of(1) + ".mask.png";
  write_mask(mask, mask_of(60, is_hand), 60);
  const Words rig{path("rig.json"), path("pictures"), "-o", path("no.png")};
  const Words alone{path("pictures"), "-o", path("no.png")};
  for (const Words& words : {rig, alone}) {
    write_mask(mask, mask_of(60, is_hand), 60);
    expect_refused(words, ".mask.png: the mask has 60x60 pixels");
    write_mask(mask, mask_of(kSide, [](int, int) { return true; }), kSide);
    expect_refused(words, "masks hide all of head '" + name_of(1) + "'");
    write(mask, "no picture");
    expect_refused(words, ".mask.png");
  }
  std::filesystem::remove(path(mask));
  const Bytes clear(std::size_t{4} * kSide * kSide, 0);
  test::write_bytes(path("pictures/" + name_of(2) + ".png"), test::png_of(clear, kSide, kSide, 4));
  expect_refused(rig, "masks hide all of head '" + name_of(2) + "' (the alpha channel of " + name_of(2) + ".png)");
  expect_refused(alone, "masks hide all of head '" + name_of(2) + "'");
  write_pictures("pictures");
  // All of what the calibration uses of the picture.
  Calibration part = town().truth;
  part.heads[1].region.right = kSide / 2.0;
  write("rig.json", to_json(part));
  write_mask(mask, mask_of(kSide, [](int x, int) { return x < kSide / 2 + 3; }), kSide);
  expect_refused(rig, "masks hide all of head '" + name_of(1) + "'");
  std::filesystem::remove(path(mask));
  write_mask("pictures/other.mask.png", mask_of(kSide, is_hand), kSide);
  expect_refused({path("pictures/" + name_of(0) + ".png"), path("pictures/other.mask.png"), "-o", path("no.png")},
                 "its picture is not given");
  const Finished run = nodal({"stitch", path("rig.json"), path("pictures"), "-o", path("yes.png")});
  EXPECT_EQ(run.code, 0) << run.err;
}

TEST_F(Masked, OfATurnedPicture_IsAsPeopleSeeIt) {
  write_pictures("pictures");
  // A JPEG whose Exif says that the camera was turned: people see it clockwise by a quarter.
  const Bytes exif{0xFF, 0xE1, 0,    34,   'E', 'x', 'i', 'f', 0, 0, 'I', 'I', 42, 0, 8, 0, 0, 0,
                   1,    0,    0x12, 0x01, 3,   0,   1,   0,   0, 0, 6,   0,   0,  0, 0, 0, 0, 0};
  Bytes jpeg = test::jpeg_of(with_hand(town().bytes[0], kSide, is_hand), kSide, kSide, test::Sampling::k444);
  jpeg.insert(jpeg.begin() + 2, exif.begin(), exif.end());
  std::filesystem::remove(path("pictures/" + name_of(0) + ".png"));
  test::write_bytes(path("pictures/" + name_of(0) + ".jpg"), jpeg);
  write_mask("pictures/" + name_of(0) + ".mask.png",
             mask_of(kSide, [](int x, int y) { return is_hand(y, kSide - 1 - x); }), kSide);
  EXPECT_EQ(pink(stitched({path("rig.json"), path("pictures"), "--blend", "board"})), 0);
}

}  // namespace
}  // namespace nodal::command_line
