// Folders as people have them: what is no picture is named with what to do, in the files' own names.
#include "host_tool/input/picture_folders.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "host_tool/input/own_pictures.h"
#include "host_tool/input/rig_pictures.h"
#include "protocol/base/file_ending.h"
#include "run_nodal.h"
#include "stitch/media/raymap/raymap_file.h"
#include "tests/support/coded_files.h"
#include "tests/support/pictures.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;
using namespace std::string_literals;

const std::string kAvif = "\0\0\0\x18"s + "ftypavif\0\0\0\0mif1avif"s;
const std::string kBrokenHeic = "\0\0\0\x18"s + "ftypheic\0\0\0\0mif1heic"s;

class FolderOfPictures : public testing::Test {
 protected:
  FolderOfPictures() { fs::create_directories(folder_ / "photos"); }
  std::string photos() const { return (folder_ / "photos").string(); }
  void write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ / ("photos/" + name), std::ios::binary) << bytes;
  }
  void write_picture(const std::string& name, int seed) const {
    test::write_bytes(folder_ / ("photos/" + name),
                      test::jpeg_of(test::smooth_rgb(64, 48, seed), 64, 48, test::Sampling::k420));
  }
  static bool says(const std::string& text, const std::string& words) { return text.find(words) != std::string::npos; }
  test::TemporaryFolder folder_;
};

TEST_F(FolderOfPictures, WhatIsNoPicture_IsNamedByItsKindAndCounted) {
  write_picture("a.jpg", 1);
  write_picture("B.JPEG", 2);
  write("c.jpg", "");
  write("d.AVIF", kAvif);
  write("e.AVIF", kAvif);
  write("g.HEIC", kBrokenHeic);
  test::write_bytes(folder_ / "photos/moving.webp", test::animated_webp());
  write("notes.txt", "Tuesday\n");
  write("film.MP4", "\0\0\0\x18"s + "ftypisom\0\0\2\0"s);
  write("f.png", "\x89PNG\r\n\x1a\n"s + "broken");
  write(".hidden", "x");
  fs::create_directory(folder_ / "photos/raw");
  const auto pictures = pictures_in(photos());
  ASSERT_TRUE(pictures) << pictures.error().text();
  EXPECT_EQ(pictures->files, (std::vector<std::string>{photos() + "/B.JPEG", photos() + "/a.jpg"}));
  const std::string& text = pictures->left_out;
  for (const char* words :
       {"2 pictures are read", "an empty file (c.jpg)", "2 AVIF files (d.AVIF, e.AVIF): convert it to JPEG or PNG",
        "a film (film.MP4): take its pictures out first", "2 broken pictures (f.png, g.HEIC)", "a folder (raw)",
        "a picture that is not read (moving.webp): it is an animated WebP; give its pictures one by one"}) {
    EXPECT_TRUE(says(text, words)) << words << " is not in: " << text;
  }
  EXPECT_TRUE(says(text, "(notes.txt)")) << text;
  EXPECT_FALSE(says(text, "hidden")) << text;
}

TEST_F(FolderOfPictures, WithoutPictures_SaysWhatIsThere) {
  write("IMG_1.avif", kAvif);
  write("IMG_2.avif", kAvif);
  const auto pictures = pictures_in(photos());
  ASSERT_FALSE(pictures);
  EXPECT_TRUE(says(pictures.error().message, "there is no picture in this folder that is read"));
  EXPECT_TRUE(says(pictures.error().message, "2 AVIF files (IMG_1.avif, IMG_2.avif): convert it to JPEG or PNG"))
      << pictures.error().message;
}

TEST_F(FolderOfPictures, Stitch_SaysOfForeignPicturesByNameWhatToDo) {
  write("a.avif", kAvif);
  write("c.heic", kBrokenHeic);
  write("b.mp4", "\0\0\0\x18"s + "ftypisom\0\0\2\0"s);
  for (const auto& [name, words] :
       std::vector<std::pair<std::string, std::string>>{{"a.avif", "is an AVIF file: convert it to JPEG or PNG"},
                                                        {"c.heic", "the HEIF file"},
                                                        {"b.mp4", "is a film: take its pictures out first"}}) {
    const std::string file = photos() + "/" + name;
    EXPECT_TRUE(is_picture(file));
    const Outcome outcome({"stitch", file, file, "-o", (folder_ / "o.jpg").string()});
    EXPECT_EQ(outcome.code, ExitCode::kBadInput);
    EXPECT_TRUE(says(outcome.err, words)) << outcome.err;
  }
  write("text.json", "{}");
  EXPECT_FALSE(is_picture(photos() + "/text.json"));
}

TEST_F(FolderOfPictures, SpheresOfEarlierRuns_AreLeftOutAndNotCounted) {
  write_picture("a.jpg", 1);
  write_picture("b.jpg", 2);
  DecodedImage sphere{PixelFormat::kRgb24, 64, 32, std::vector<std::uint8_t>(3 * 64 * 32, 90)};
  media::RaymapFile file;
  file.layout = "equirectangular";
  file.format = media::RaymapFormat::kJpg;
  for (const char* name : {"photos/x.jpg", "photos/y.jpg"}) {
    test::write_bytes(folder_ / name, media::encode(sphere, file).value());
    sphere.bytes[0] = 20;
  }
  const auto own = own_pictures({photos()});
  ASSERT_TRUE(own) << own.error().text();
  EXPECT_EQ(own->files()[0], (std::vector<std::string>{photos() + "/a.jpg", photos() + "/b.jpg"}));
  ASSERT_EQ(own->notes.size(), 1u);
  EXPECT_TRUE(says(own->notes[0], ": 2 pictures are read; left out: 2 spheres (x.jpg and others)")) << own->notes[0];
  fs::create_directory(folder_ / "photos/raw");
  const auto more = own_pictures({photos()});
  ASSERT_TRUE(more) << more.error().text();
  EXPECT_TRUE(says(more->notes[0], ": 2 pictures are read; left out: a folder (raw)")) << more->notes[0];
  EXPECT_TRUE(says(more->notes[0], "; 2 spheres (x.jpg and others)")) << more->notes[0];
}

TEST_F(FolderOfPictures, TheSamePictureTwice_IsLeftOutByItsName) {
  write_picture("IMG 1.jpg", 1);
  write_picture("IMG 2.jpg", 2);
  fs::copy_file(folder_ / "photos/IMG 1.jpg", folder_ / "photos/IMG 1 copy.jpg");
  const auto own = own_pictures({photos()});
  ASSERT_TRUE(own) << own.error().text();
  ASSERT_EQ(own->sets.size(), 1u);
  EXPECT_EQ(own->files()[0], (std::vector<std::string>{photos() + "/IMG 1.jpg", photos() + "/IMG 2.jpg"}));
  ASSERT_EQ(own->notes.size(), 1u);
  EXPECT_TRUE(says(own->notes[0], "IMG 1 copy.jpg is left out: it is the same picture as "));
  EXPECT_TRUE(says(own->notes[0], "IMG 1.jpg")) << own->notes[0];
  const auto only = own_pictures({photos() + "/IMG 1.jpg", photos() + "/IMG 1 copy.jpg"});
  ASSERT_FALSE(only);
  EXPECT_TRUE(says(only.error().message, "are the same picture")) << only.error().message;
}

TEST_F(FolderOfPictures, PicturesOfOneSet_AreOpenedOnceAndDecodedOnce) {
  write_picture("a.jpg", 1);
  write_picture("b.jpg", 2);
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{photos()}, {photos() + "/a.jpg", photos() + "/b.jpg"}}) {
    auto own = own_pictures(words);
    ASSERT_TRUE(own) << own.error().text();
    fs::rename(folder_ / "photos", folder_ / "away");  // what is open stays readable, and nothing else
    for (HeadPicture& picture : own->sets[0]) EXPECT_TRUE(picture.decode(false));
    for (const std::string& name : own->heads) {
      own->calibration.heads.emplace_back().name = name;
      own->calibration.heads.back().width = 64;
      own->calibration.heads.back().height = 48;
    }
    EXPECT_TRUE(take_set(*own, 0, false)) << "their pixels are there";
    EXPECT_FALSE(take_set(*own, 0, false)) << "and then they are not kept";
    fs::rename(folder_ / "away", folder_ / "photos");
  }
}

TEST_F(FolderOfPictures, TheSamePictureForTwoHeads_IsTold) {
  write_picture("a.jpg", 1);
  fs::copy_file(folder_ / "photos/a.jpg", folder_ / "photos/b.jpg");
  write("rig.pto", "i w64 h48 f0 v60 n\"a.jpg\"\ni w64 h48 f0 v60 y40 n\"b.jpg\"\n");
  const auto input = read_rig_pictures({}, {photos() + "/rig.pto"});
  ASSERT_TRUE(input) << input.error().text();
  ASSERT_EQ(input->notes.size(), 1u);
  EXPECT_TRUE(says(input->notes[0], "b.jpg and ") && says(input->notes[0], "are the same picture")) << input->notes[0];
  // One file with both heads' pictures is no mistake.
  write("one.pto", "i w64 h48 f0 v60 S0,32,0,48 n\"a.jpg\"\ni w64 h48 f0 v60 y40 S32,64,0,48 n\"a.jpg\"\n");
  EXPECT_TRUE(read_rig_pictures({}, {photos() + "/one.pto"})->notes.empty());
}

TEST_F(FolderOfPictures, InASequence_APictureThatCannotBeReadIsAnError) {
  for (const char* head : {"photos/front", "photos/back"}) fs::create_directories(folder_ / head);
  for (const char* name : {"front/1.jpg", "front/2.jpg", "back/1.jpg", "back/2.jpg"}) write_picture(name, 1);
  const std::vector<std::string> folders{photos() + "/front", photos() + "/back"};
  EXPECT_TRUE(own_pictures(folders));
  for (const char* name : {"front/0.jpg", "back/0.jpg"}) write(name, "");
  for (const auto& refused : {own_pictures(folders).error(), picture_files(folders, {"front", "back"}).error()}) {
    EXPECT_TRUE(says(refused.message, "0.jpg") && says(refused.message, "empty")) << refused.message;
    EXPECT_TRUE(says(refused.message, "in a sequence every picture counts")) << refused.message;
  }
}

TEST(EndingsOfNames, InAnyCase_AreTheSame) {
  for (const auto& [name, format] :
       std::vector<std::pair<std::string, media::RaymapFormat>>{{"t.JPG", media::RaymapFormat::kJpg},
                                                                {"t.Jpeg", media::RaymapFormat::kJpg},
                                                                {"t.PNG", media::RaymapFormat::kPng},
                                                                {"t.TIF", media::RaymapFormat::kTiff},
                                                                {"t.tIFf", media::RaymapFormat::kTiff},
                                                                {"t.RAW", media::RaymapFormat::kRaw}}) {
    const Result<media::RaymapFormat> found = media::raymap_format_of_name(name);
    ASSERT_TRUE(found) << name;
    EXPECT_EQ(*found, format) << name;
  }
  EXPECT_FALSE(media::raymap_format_of_name("t.jpgx"));
  EXPECT_FALSE(has_ending("g", ".jpg"));
  EXPECT_FALSE(has_ending("t_JPG", ".jpg"));
}

}  // namespace
}  // namespace nodal::host
