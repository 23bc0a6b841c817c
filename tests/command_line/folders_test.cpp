// Folders of pictures: what they are taken for, by every command.
#include "stitch_command.h"
#include "tests/support/film.h"

namespace nodal::command_line {
namespace {

TEST_F(StitchCommand, FoldersWithoutACalibration_AreCalibratedByTheMiddleSetAndStitchedFrameByFrame) {
  write_pictures("set");
  Words folders;
  for (std::size_t h = 0; h < town().truth.heads.size(); ++h) {
    std::filesystem::create_directories(path("film/" + name_of(h)));
    for (const char* frame : {"0001.png", "0002.png", "0003.png"}) {
      std::filesystem::copy_file(path("set/" + name_of(h) + ".png"), path("film/" + name_of(h) + "/" + frame));
    }
    folders.push_back(path("film/" + name_of(h)));
  }
  Words one_name = folders;
  one_name.insert(one_name.end(), {"-o", path("f.jpg")});
  expect_refused(one_name, "put %04d into it");
  EXPECT_FALSE(std::filesystem::exists(path("f.rig.json"))) << "refused before it is calibrated";
  Words words{"stitch"};
  words.insert(words.end(), folders.begin(), folders.end());
  words.insert(words.end(), {"--width", "256", "-o", path("f-%02d.png")});
  const Json answer = nodal_json(words).at(0);
  EXPECT_EQ(answer["raymaps"], 3);
  EXPECT_EQ(answer["calibration_file"], path("f.rig.json"));
  EXPECT_NE(answer["notes"].dump().find("set 2 of 3"), std::string::npos) << answer;
  // The heads are called after their folders, so that the calibration serves for the folders again.
  Words again{"stitch", path("f.rig.json")};
  again.insert(again.end(), folders.begin(), folders.end());
  again.insert(again.end(), {"--width", "256", "-o", path("g-%02d.png")});
  const Finished run = nodal(again);
  ASSERT_EQ(run.code, 0) << run.err;
  for (const char* file : {"-00.png", "-01.png", "-02.png"}) {
    EXPECT_EQ(read("f" + std::string(file)), read("g" + std::string(file))) << file;
  }
  // Stitch and register take the folders for the same, and say so.
  const std::string taken = "6 folders: each has the pictures of one head, 3 in each, sorted by name";
  EXPECT_NE(answer["notes"].dump().find(taken), std::string::npos) << answer["notes"];
  EXPECT_NE(run.err.find(taken), std::string::npos) << run.err;
  Words alone{"register"}, calibrated{"register", path("f.rig.json")};
  for (Words* command : {&alone, &calibrated}) {
    command->insert(command->end(), folders.begin(), folders.end());
    command->insert(command->end(), {"-o", path("r.json")});
    const Finished registered = nodal(*command);
    EXPECT_EQ(registered.code, 0) << registered.err;
    EXPECT_NE(registered.err.find(taken), std::string::npos) << registered.err;
  }
  write_pictures("later");
  const Finished sets = nodal({"register", path("rig.json"), path("set"), path("later"), "-o", path("r.json")});
  EXPECT_NE(sets.err.find("2 folders: each has one picture of each of the 6 heads"), std::string::npos) << sets.err;
  std::filesystem::remove(path("film/" + name_of(1) + "/0003.png"));
  Words uneven = folders;
  uneven.insert(uneven.end(), {"-o", path("f-%d.png")});
  expect_refused(uneven, name_of(1));
}

/// A film of the same JPEG; its pictures are 40 ms apart and begin at `from_ms`.
std::vector<std::uint8_t> film(const std::vector<std::uint8_t>& rgb, int pictures, std::uint64_t from_ms) {
  take::VideoTrack track;
  track.width = track.height = kSide;
  const std::vector<std::uint8_t> jpeg = test::jpeg_of(rgb, kSide, kSide, test::Sampling::k444, 100);
  std::vector<test::TimedPicture> all;
  for (int k = 0; k < pictures; ++k) {
    all.push_back({(from_ms + 40 * static_cast<std::uint64_t>(k)) * 1'000'000U, jpeg});
  }
  return test::film_of(track, all, true);
}

TEST_F(StitchCommand, AFilmOfEachHead_IsStitchedAndRegisteredByThePicturesOfOneMoment) {
  write_pictures("set");
  std::filesystem::create_directories(path("jpegs"));
  Words films, pictures;
  for (std::size_t h = 0; h < town().bytes.size(); ++h) {
    films.push_back(path(name_of(h) + ".mkv"));
    // The second head's film begins two pictures later.
    test::write_bytes(films.back(), film(town().bytes[h], h == 1 ? 8 : 10, h == 1 ? 1080 : 1000));
    pictures.push_back(path("jpegs/" + name_of(h) + ".jpg"));
    test::write_bytes(pictures.back(), test::jpeg_of(town().bytes[h], kSide, kSide, test::Sampling::k444, 100));
  }
  const auto with = [](Words words, const Words& more, const Words& last) {
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), last.begin(), last.end());
    return words;
  };
  const Finished run = nodal(with({"stitch", path("rig.json")}, films, {"-o", path("film.png")}));
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("6 films: the pictures at 0.20 s"), std::string::npos) << "between 0.08 and 0.36 s\n"
                                                                                << run.err;
  ASSERT_EQ(nodal(with({"stitch", path("rig.json")}, pictures, {"-o", path("one.png")})).code, 0);
  EXPECT_EQ(read("film.png"), read("one.png"));
  const Finished alone = nodal(with({"register"}, films, {"-o", path("alone.json")}));
  ASSERT_EQ(alone.code, 0) << alone.err;
  const auto found = parse_calibration(read("alone.json"));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->heads[1].name, name_of(1)) << "called after the film";
  EXPECT_LT(test::rotation_error(town().truth, *found).max_deg, 1);
  // A picture that a camera lost is not missed.
  Words lossy = films;
  lossy[1] = path("lossy.mkv");
  const std::vector<std::uint8_t> jpeg = test::jpeg_of(town().bytes[1], kSide, kSide, test::Sampling::k444, 100);
  take::VideoTrack track;
  track.width = track.height = kSide;
  test::write_bytes(lossy[1],
                    test::film_of(track, {{1'080'000'000, jpeg}, {1'120'000'000, jpeg}, {1'360'000'000, jpeg}}, true));
  const Finished passed = nodal(with({"stitch", path("rig.json")}, lossy, {"-o", path("lossy.png")}));
  EXPECT_NE(passed.err.find("6 films: the pictures at 0.12 s"), std::string::npos) << passed.err;
  // Films of another time, too few, and no film at all.
  test::write_bytes(films[1], film(town().bytes[1], 8, 9000));
  expect_refused(with({path("rig.json")}, films, {"-o", path("no.png")}), "give films of one take");
  films.pop_back();
  expect_refused(with({path("rig.json")}, films, {"-o", path("no.png")}), "5 films for 6 heads");
}

TEST_F(StitchCommand, SeventyPictures_AreRefusedWithWhatToDo) {
  std::filesystem::create_directories(path("many"));
  for (int n = 0; n < 70; ++n) {
    test::write_bytes(path("many/" + std::to_string(n) + ".png"), test::png_of(test::smooth_rgb(48, 32, n), 48, 32, 3));
  }
  expect_refused({path("many"), "-o", path("no.png")},
                 "70 pictures, and at most 64 can be placed together; leave some");
}

}  // namespace
}  // namespace nodal::command_line
