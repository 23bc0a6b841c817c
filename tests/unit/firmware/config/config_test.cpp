#include "firmware/config/config.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "stitch/geometry/raymap/registry.h"

namespace nodal::firmware {
namespace {

std::string example() {
  std::ifstream in(std::string(NODAL_SOURCE_DIR) + "/firmware/example.rig.toml");
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

const std::string kSmall = R"([rig]
name = "small"
[sim]
calibration = "truth.json"
[[heads]]
name = "cam0"
port = "sim:cam0"
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

void expect_refused(const std::string& text, Errc code, const std::string& part) {
  const auto config = parse_rig_config(text, "rig.toml");
  ASSERT_FALSE(config) << text;
  EXPECT_EQ(config.error().code, code) << config.error().text();
  EXPECT_NE(config.error().message.find(part), std::string::npos) << config.error().message << "\nlacks: " << part;
}

TEST(RigConfig, TheExample_IsReadWhole) {
  const auto config = parse_rig_config(example(), "example.rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->name, "ten-heads");
  EXPECT_EQ(config->rate, (FrameRate{30000, 1001}));
  EXPECT_EQ(config->raymap.width, 2048);
  EXPECT_EQ(config->raymap.height, 1024);
  ASSERT_EQ(config->heads.size(), 10u);
  EXPECT_EQ(config->heads[9].name, "cam9");
  EXPECT_EQ(config->heads[9].port, (PortAddress{PortKind::kSim, "cam9"}));
  EXPECT_EQ(config->heads[0].exposure->us(), 8000);
  EXPECT_FALSE(config->heads[1].exposure.has_value());
  ASSERT_TRUE(config->sim.has_value());
  EXPECT_DOUBLE_EQ(config->sim->noise, 1.0);
}

TEST(RigConfig, AListOfRays_IsReadByItsNameAndNamedByItsContents) {
  const auto read = [](const std::string& file) -> Result<std::string> {
    std::string list = "rays 16 16\n";
    for (int k = 0; k < 256; ++k) list += "1 0 " + std::to_string(k) + "\n";
    if (file == "four.rays") return list;
    return fail(Errc::kNotFound, file + ": there is no such file");
  };
  const auto layout = [](const std::string& of) { return kSmall + "[raymap]\nlayout = \"rays:" + of + "\"\n"; };
  const auto config = parse_rig_config(layout("four.rays"), "rig.toml", read);
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->raymap.width, 16);
  EXPECT_EQ(config->raymap.height, 16);
  EXPECT_TRUE(config->raymap.layout.starts_with("rays:")) << config->raymap.layout;
  const auto refused = [&](const std::string& of, const std::string& says) {
    const auto bad = parse_rig_config(of, "rig.toml", read);
    ASSERT_FALSE(bad) << says;
    EXPECT_NE(bad.error().message.find(says), std::string::npos) << bad.error().message;
  };
  refused(layout("gone.rays"), "gone.rays: there is no such file");
  refused(layout("../four.rays"), "give its name without a folder");
  refused(layout("four.rays") + "width = 32\n", "is not the size of the list of rays, 16x16");
  expect_refused(layout("four.rays"), Errc::kUnsupported, "lists of rays are not read here");
}

TEST(RigConfig, SeparateFields_WantEveryHeadInterlacedInOneOrder) {
  const std::string separate = kSmall + "fields = \"bottom-first\"\n[raymap]\nfields = \"separate\"\n";
  const auto config = parse_rig_config(separate, "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->raymap.fields, FieldUse::kSeparate);
  EXPECT_EQ(config->raymap.raymaps_a_set(), 2);
  EXPECT_EQ(parse_rig_config(kSmall, "rig.toml")->raymap.raymaps_a_set(), 1);
  const std::string second = "[[heads]]\nname = \"cam1\"\nport = \"sim:cam1\"\n";
  expect_refused(separate + second, Errc::kBadValue, "the frames of head 'cam1' are progressive");
  expect_refused(separate + second + "fields = \"top-first\"\n", Errc::kBadValue,
                 "heads 'cam0' and 'cam1' do not expose the same field first");
}

TEST(RigConfig, Transition_TakesTheWidthsThatItUsesWithinTheirLimits) {
  const std::string sharp = kSmall + "[raymap]\ntransition = \"seam\"\n";
  const auto seam = parse_rig_config(sharp + "seam_width = 2.5\n", "rig.toml");
  ASSERT_TRUE(seam) << seam.error().text();
  EXPECT_EQ(seam->raymap.transition, nodal::Transition::kSeam);
  EXPECT_EQ(seam->raymap.seam_width_deg, 2.5);
  EXPECT_TRUE(parse_rig_config(sharp + "seam_width = 0\n", "rig.toml"));
  const std::string soft = kSmall + "[raymap]\ntransition = \"feather\"\n";
  const auto wide = parse_rig_config(soft + "feather = 0.2\n", "rig.toml");
  ASSERT_TRUE(wide) << wide.error().text();
  EXPECT_EQ(wide->raymap.transition, nodal::Transition::kFeather);
  EXPECT_EQ(wide->raymap.feather, 0.2);
  const auto both = parse_rig_config(kSmall + "[raymap]\nfeather = 0.2\nseam_width = 3\n", "rig.toml");
  ASSERT_TRUE(both) << both.error().text();
  EXPECT_EQ(both->raymap.transition, nodal::Transition::kTwoBand);
  EXPECT_EQ(both->raymap.feather, 0.2);
  EXPECT_EQ(both->raymap.seam_width_deg, 3);
  for (const char* width : {"-0.1", "180.1", "1e300", "nan", "inf", "-inf", "\"1\""}) {
    expect_refused(sharp + "seam_width = " + width + "\n", Errc::kBadValue, "raymap.seam_width");
  }
  expect_refused(sharp + "feather = 0.5\n", Errc::kBadValue, "raymap.feather");
  expect_refused(soft + "seam_width = 1\n", Errc::kBadValue, "raymap.seam_width");
}

TEST(RigConfig, PlacedSeams_NeedSeams) {
  const auto placed = parse_rig_config(kSmall + "[raymap]\nseams = \"placed\"\n", "rig.toml");
  ASSERT_TRUE(placed) << placed.error().text();
  EXPECT_EQ(placed->raymap.seams, SeamPlacement::kPlaced);
  EXPECT_TRUE(parse_rig_config(kSmall + "[raymap]\ntransition = \"feather\"\nseams = \"fixed\"\n", "rig.toml"));
  expect_refused(kSmall + "[raymap]\ntransition = \"feather\"\nseams = \"placed\"\n", Errc::kBadValue, "raymap.seams");
  expect_refused(kSmall + "[raymap]\nseams = \"moving\"\n", Errc::kBadValue, "raymap.seams");
}

TEST(RigConfig, NearlyNothing_TakesTheDefaultsOfRigMd) {
  const auto config = parse_rig_config(kSmall, "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->rate.period().ns(), 33'366'666);
  EXPECT_EQ(config->raymap.format, PixelFormat::kI420);
  EXPECT_EQ(config->raymap.jpeg_quality, 85);
  EXPECT_EQ(config->raymap.transition, nodal::Transition::kTwoBand);
  EXPECT_EQ(config->raymap.seam_width_deg, 1);
  EXPECT_EQ(config->raymap.feather, 0.5);
  EXPECT_EQ(config->raymap.seams, SeamPlacement::kFixed);
  EXPECT_TRUE(config->raymap.soft);
  EXPECT_FALSE(config->trigger.start);
  EXPECT_EQ(config->links.view_path, "") << "a view-only socket only on demand";
  EXPECT_EQ(config->links.operate_path, "") << "an operate socket only on demand";
  EXPECT_EQ(config->links.usb_folder, "") << "a cable only on demand";
  EXPECT_FALSE(config->links.unix_file.mode) << "the umask decides";
  EXPECT_EQ(config->store, "/var/lib/nodal");
}

TEST(RigConfig, ATriggerToFollowAndAHeadsDelay_AreReadAndHeldToTheirLimits) {
  const std::string text = kSmall + "trigger_delay_us = 1500\n[trigger]\nsource = \"external\"\n";
  const auto config = parse_rig_config(text, "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->trigger.source, SyncSource::kExternal);
  EXPECT_EQ(config->heads[0].trigger_delay, Duration::microseconds(1500));
  expect_refused(kSmall + "trigger_delay_us = 33367\n", Errc::kBadValue, "heads[0].trigger_delay_us must be shorter");
  expect_refused("[rig]\nname='r'\n[[heads]]\nname='a'\nport='replay:a-*.png'\ntrigger_delay_us = 5\n", Errc::kBadValue,
                 "heads[0].trigger_delay_us is not allowed");
}

TEST(RigConfig, NoTrigger_HeadsAreAlignedAndADelayAfterAPulseIsRefusedByName) {
  const auto config = parse_rig_config(kSmall + "[trigger]\nsource = \"none\"\nstart = true\n", "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->trigger.source, SyncSource::kNone);
  expect_refused(kSmall + "trigger_delay_us = 5\n[trigger]\nsource = \"none\"\n", Errc::kBadValue,
                 "trigger has source = \"none\"");
}

TEST(RigConfig, SimulatedPins_AreKeptAsText) {
  const auto config = parse_rig_config(kSmall + "[panel]\nbutton = \"sim:1+1\"\n", "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->panel.button, "sim:1+1");
  EXPECT_EQ(config->panel.button_line, std::nullopt);
  EXPECT_EQ(config->panel.tally, "");
}

TEST(RigConfig, ReplayHeads_NeedNoSim) {
  const auto config = parse_rig_config("[rig]\nname='r'\n[[heads]]\nname='a'\nport='replay:a-*.png'\n", "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->heads[0].port, (PortAddress{PortKind::kReplay, "a-*.png"}));
}

const std::string kDevice = "[rig]\nname='r'\n[[heads]]\nname='a'\nport='v4l2:/dev/video0'\n";

TEST(RigConfig, V4l2Heads_AreAskedWhatStandsThereAndNothingElse) {
  const auto plain = parse_rig_config(kDevice, "rig.toml");
  ASSERT_TRUE(plain) << plain.error().text();
  EXPECT_EQ(plain->heads[0].port, (PortAddress{PortKind::kV4l2, "/dev/video0"}));
  EXPECT_EQ(plain->heads[0].port.text(), "v4l2:/dev/video0");
  EXPECT_EQ(plain->heads[0].device, DeviceConfig{});
  const auto full = parse_rig_config(kDevice +
                                         "size='720x480'\ninput='S-Video'\nstandard='NTSC'\ngain_step_mdb=100\nreadout_"
                                         "us=16000\nfields='bottom-first'\nseparate_fields=true\n",
                                     "rig.toml");
  ASSERT_TRUE(full) << full.error().text();
  EXPECT_EQ(full->heads[0].device,
            (DeviceConfig{720, 480, "S-Video", "NTSC", 100, Duration::microseconds(16'000), true}));
}

TEST(RigConfig, WhatADeviceCannotBeAsked_IsRefused) {
  for (const char* const size : {"720", "720x", "x480", "720X480", "720x480x2", "0x480", "720x16385", "-720x480"}) {
    expect_refused(kDevice + "size='" + size + "'\n", Errc::kBadValue, "WIDTHxHEIGHT");
  }
  expect_refused(kDevice + "separate_fields=true\n", Errc::kBadValue, "needs interlaced frames");
  expect_refused(kDevice + "trigger_delay_us=100\n", Errc::kBadValue, "trigger_mode = \"wired\"");
  const auto wired = parse_rig_config(kDevice + "trigger_mode='wired'\ntrigger_delay_us=100\n", "rig.toml");
  ASSERT_TRUE(wired) << wired.error().text();
  EXPECT_TRUE(wired->heads[0].wired);
  EXPECT_EQ(wired->heads[0].trigger_delay, Duration::microseconds(100));
  EXPECT_FALSE(parse_rig_config(kDevice + "trigger_mode='input'\n", "rig.toml")->heads[0].wired);
  expect_refused(kDevice + "trigger_mode='genlock'\n", Errc::kBadValue, "allowed is one of input, wired");
  expect_refused(kDevice + "trigger_mode='wired'\n[trigger]\nsource='none'\n", Errc::kBadValue, "'a'");
  expect_refused(kSmall + "size='720x480'\n", Errc::kBadValue, "only allowed for v4l2: and iidc: ports");
  expect_refused(kDevice + "left=8\ntop=2\n", Errc::kBadValue, "only allowed for iidc: ports");
  expect_refused(replaced(kDevice, "v4l2:/dev/video0", "v4l2:"), Errc::kBadValue, "v4l2:DEVICE");
  expect_refused(
      replaced(kSmall, "[sim]", "[sim]\nclock = \"fast\"") + "[[heads]]\nname='a'\nport='v4l2:/dev/video0'\n",
      Errc::kBadValue, "real time");
}

const std::string kIidc = "[rig]\nname='r'\n[[heads]]\nname='a'\nformat='UYVY'\nport='iidc:00b09d0100c0ffee'\n";

TEST(RigConfig, IidcHeads_AreAskedWhatStandsThere) {
  const auto plain = parse_rig_config(kIidc, "rig.toml");
  ASSERT_TRUE(plain) << plain.error().text();
  EXPECT_EQ(plain->heads[0].port, (PortAddress{PortKind::kIidc, "00b09d0100c0ffee"}));
  EXPECT_EQ(plain->heads[0].port.text(), "iidc:00b09d0100c0ffee");
  EXPECT_EQ(plain->heads[0].device, DeviceConfig{});
  const auto full = parse_rig_config(kIidc +
                                         "size='640x400'\nleft=8\ntop=40\npacket_bytes=2048\ngain_step_mdb=100\n"
                                         "readout_us=9000\nexposure_by='pulse'\ntrigger_delay_us=5\n",
                                     "rig.toml");
  ASSERT_TRUE(full) << full.error().text();
  DeviceConfig device{640, 400, "", "", 100, Duration::microseconds(9'000), false, 8, 40, 2048, true};
  EXPECT_EQ(full->heads[0].device, device);
}

TEST(RigConfig, WhatAnIidcCameraCannotBeAsked_IsRefused) {
  expect_refused(replaced(kIidc, "UYVY", "YUYV"), Errc::kBadValue, "IIDC cameras have GREY, UYVY, YUV411");
  expect_refused(kIidc + "left=8\n", Errc::kMissingField, "needs both");
  expect_refused(kIidc + "input='S-Video'\n", Errc::kBadValue, "only allowed for v4l2: ports");
  expect_refused(kIidc + "fields='top-first'\n", Errc::kBadValue, "must be \"progressive\" for iidc: ports");
  expect_refused(replaced(kIidc, "iidc:00b09d0100c0ffee", "iidc:"), Errc::kBadValue, "iidc:GUID");
  expect_refused(kIidc + "exposure_by='hand'\n", Errc::kBadValue, "shutter, pulse");
}

TEST(RigConfig, TypingErrorInAKey_NamesLineAndTheNearestKnownKey) {
  expect_refused(replaced(kSmall, "port = ", "prot = "), Errc::kUnknownField,
                 "rig.toml:7:1: there is no key 'heads[0].prot'; did you mean 'port'?");
  expect_refused(kSmall + "[raymapp]\n", Errc::kUnknownField, "did you mean 'raymap'?");
}

TEST(RigConfig, KeyLikeNoOther_ListsWhatIsKnown) {
  expect_refused(replaced(kSmall, "name = \"small\"", "name = \"small\"\ncolour_temperature = 3"), Errc::kUnknownField,
                 "the keys allowed here are name, rate");
}

TEST(RigConfig, NotToml_NamesLineAndColumn) { expect_refused("[rig]\nname = \"x\n", Errc::kBadFormat, "rig.toml:2:"); }

TEST(RigConfig, MissingThings_AreNamed) {
  expect_refused("", Errc::kMissingField, "rig is missing");
  expect_refused("[rig]\nname='r'\n", Errc::kMissingField, "heads is missing");
  expect_refused(replaced(kSmall, "name = \"small\"", ""), Errc::kMissingField, "rig.name is missing");
  expect_refused(replaced(kSmall, "[sim]\ncalibration = \"truth.json\"\n", ""), Errc::kMissingField, "sim is missing");
  expect_refused(replaced(kSmall, "calibration = \"truth.json\"", ""), Errc::kMissingField, "sim.calibration");
}

TEST(RigConfig, EveryLayout_CanBeNamedAndHasAUsualSize) {
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
    const std::string name(kind.name);
    const auto config = parse_rig_config(kSmall + "[raymap]\nlayout = '" + name + "'\n", "rig.toml");
    ASSERT_TRUE(config) << config.error().text();
    EXPECT_EQ(config->raymap.layout, name);
    EXPECT_TRUE(geometry::LayoutName::parse(name)->check_size({config->raymap.width, config->raymap.height})) << name;
  }
  const auto cube = parse_rig_config(kSmall + "[raymap]\nlayout = 'cube:pad=2'\nwidth = 600\n", "rig.toml");
  ASSERT_TRUE(cube) << cube.error().text();
  EXPECT_EQ(cube->raymap.layout, "cube:pad=2");
  EXPECT_EQ(cube->raymap.height, 400) << "as the width demands";
}

TEST(RigConfig, ValuesOutsideTheirLimits_SayWhatIsAllowed) {
  expect_refused(kSmall + "exposure_us = 0\n", Errc::kBadValue,
                 "rig.toml:8:15: heads[0].exposure_us is 0; allowed is 1 to 10000000");
  expect_refused(kSmall + "gain_mdb = 1.5\n", Errc::kBadValue, "heads[0].gain_mdb must be a whole number");
  expect_refused(kSmall + "format = \"YUY2\"\n", Errc::kBadValue, "allowed is one of I420, NV12, YUYV");
  expect_refused(kSmall + "red_q12 = 5000\n", Errc::kMissingField, "heads[0].blue_q12 is missing");
  expect_refused(replaced(kSmall, "sim:cam0", "usb:1-2"), Errc::kBadValue, "sim:NAME, replay:FILE");
  expect_refused(replaced(kSmall, "sim:cam0", "sim:"), Errc::kBadValue, "sim:NAME");
  expect_refused(
      kSmall + "[raymap]\nwidth=2000\nheight=1024\n", Errc::kBadValue,
      "raymap.height is 1024: 2000x1024 is not a size of the layout equirectangular, whose size is a multiple of "
      "4x2; 2000x1000 would be");
  expect_refused(kSmall + "[raymap]\nlayout='cube'\nwidth=1536\nheight=768\n", Errc::kBadValue,
                 "multiple of 6x4; 1536x1024 would be");
  expect_refused(kSmall + "[raymap]\nlayout='gnomonic'\n", Errc::kUnsupported, "there are: equirectangular, cube");
  expect_refused(kSmall + "[raymap]\nlayout='cube:pad=99'\n", Errc::kBadValue, "from 0 to 64");
  expect_refused(kSmall + "[raymap]\nlayout='cube:pad=64'\nwidth=300\nheight=200\n", Errc::kBadValue,
                 "390x260 would be");
  expect_refused(kSmall + "[raymap]\nlayout='hammersley'\nwidth=101\n", Errc::kBadValue, "sides are even");
  expect_refused(replaced(kSmall, "[sim]\n", "[sim]\nnoise = nan\n"), Errc::kBadValue, "sim.noise is nan");
  expect_refused(replaced(kSmall, "[sim]\n", "[sim]\nscene = \"photo\"\n"), Errc::kMissingField, "sim.photo");
  expect_refused(replaced(kSmall, "[sim]\n", "[sim]\nscene='constant'\nconstant=[1,2,256]\n"), Errc::kBadValue,
                 "[red, green, blue]");
  expect_refused(replaced(kSmall, "\"small\"", "\"a b\""), Errc::kBadValue, "rig.name must be 1 to 64");
}

TEST(RigConfig, RaymapFormats_AreReadAndHeadsMustDeliverWhatTheyAreMadeOf) {
  const struct {
    const char* raymap;
    const char* head;
    PixelFormat format;
  } fits[] = {{"NV12", "YUYV", PixelFormat::kNv12},
              {"RGB48", "RGB24", PixelFormat::kRgb48},
              {"GREY16", "GREY", PixelFormat::kGrey16},
              {"GREY", "GREY", PixelFormat::kGrey8}};
  for (const auto& [raymap, head, format] : fits) {
    const auto config =
        parse_rig_config(kSmall + "format = \"" + head + "\"\n[raymap]\nformat = \"" + raymap + "\"\n", "rig.toml");
    ASSERT_TRUE(config) << config.error().text();
    EXPECT_EQ(config->raymap.format, format);
  }
  expect_refused(kSmall + "format = \"YUYV\"\n[raymap]\nformat = \"RGB48\"\n", Errc::kBadValue,
                 "raymap.format is \"RGB48\", which needs heads with RGB24, MJPEG or a Bayer format, but the format of "
                 "head 'cam0' is YUYV");
  expect_refused(kSmall + "[raymap]\nformat = \"YUYV\"\n", Errc::kBadValue,
                 "allowed is one of I420, NV12, RGB24, GREY, RGB48, GREY16");
}

TEST(RigConfig, FormatsThatAreDecoded_FitEveryRaymapButNoFieldsAndNoReplayedMosaic) {
  for (const char* const format : {"MJPEG", "RGGB8", "GRBG8", "GBRG8", "BGGR8"}) {
    for (const char* const raymap : {"I420", "NV12", "RGB24", "GREY", "RGB48", "GREY16"}) {
      const std::string text = "[rig]\nname = \"a\"\n[raymap]\nwidth = 64\nheight = 32\nformat = \"" +
                               std::string(raymap) + "\"\n[[heads]]\nname = \"cam0\"\nport = \"v4l2:x\"\nformat = \"" +
                               format + "\"\n";
      EXPECT_TRUE(parse_rig_config(text, "rig.toml")) << format << " " << raymap;
      const auto fields = parse_rig_config(text + "fields = \"top-first\"\n", "rig.toml");
      ASSERT_FALSE(fields);
      EXPECT_NE(fields.error().message.find("not taken apart into fields"), std::string::npos) << fields.error().text();
    }
  }
  const auto replayed = parse_rig_config(
      "[rig]\nname = \"a\"\n[raymap]\nwidth = 64\nheight = 32\n[[heads]]\nname = \"cam0\"\nport = "
      "\"replay:a.png\"\nformat = \"RGGB8\"\n",
      "rig.toml");
  ASSERT_FALSE(replayed);
  EXPECT_NE(replayed.error().message.find("cannot be RGGB8 for replay"), std::string::npos) << replayed.error().text();
}

TEST(RigConfig, RatesThatAreNoFraction_AreRefused) {
  for (const char* rate : {"0", "30/0", "29.97", "1001/", "/1", "-30", "2000", "1/2000", "30 /1", "",
                           "299700300/10000000", "2997003/100000", "4294967295/4294967291"}) {
    expect_refused(replaced(kSmall, "name = \"small\"", "name = \"small\"\nrate = \"" + std::string(rate) + "\""),
                   Errc::kBadValue, "rig.rate must be frames a second");
  }
  const auto config = parse_rig_config(replaced(kSmall, "name = \"small\"", "name = \"small\"\nrate = \"25\""), "r");
  ASSERT_TRUE(config) << config.error().text();
  EXPECT_EQ(config->rate, (FrameRate{25, 1}));
  const auto reduced =
      parse_rig_config(replaced(kSmall, "name = \"small\"", "name = \"small\"\nrate = \"4294967295/4294967295\""), "r");
  ASSERT_TRUE(reduced) << reduced.error().text();
  EXPECT_EQ(reduced->rate, (FrameRate{1, 1}));
}

TEST(RigConfig, ATcpPort_IsRefusedAndSaysWhatServesInItsPlace) {
  expect_refused(kSmall + "[links]\ntcp_port = 7700\n", Errc::kBadValue, "is no longer supported");
  expect_refused(kSmall + "[links]\ntcp_port = 7700\n", Errc::kBadValue, "ssh");
}

TEST(RigConfig, TwoHeadsOfOneNameOrPort_AreRefused) {
  expect_refused(kSmall + "[[heads]]\nname='cam0'\nport='sim:cam1'\n", Errc::kBadValue,
                 "is the name of a head above, too");
  expect_refused(kSmall + "[[heads]]\nname='cam1'\nport='sim:cam0'\n", Errc::kBadValue, "heads[1].port is the port of");
}

TEST(RigConfig, MoreHeadsThanARigHas_AreRefused) {
  std::string text = "[rig]\nname='r'\n";
  for (int i = 0; i < kMaxHeads + 1; ++i) {
    text += "[[heads]]\nname='c" + std::to_string(i) + "'\nport='replay:" + std::to_string(i) + ".png'\n";
  }
  expect_refused(text, Errc::kBadValue, "has 17 entries; a rig has at most 16");
}

TEST(RigConfig, AFileOfMegabytes_IsRefusedUnread) {
  expect_refused(std::string(kMaxRigTomlBytes + 1, '#'), Errc::kTooLarge, "at most 262144");
}

}  // namespace
}  // namespace nodal::firmware
