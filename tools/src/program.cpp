#include "program.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <new>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "limber/core/error.h"
#include "limber/core/version.h"
#include "limber/internal/strict_json.h"

namespace limber::tools {
namespace {

constexpr int kGood = 0, kFailed = 1, kWrongUsage = 2;

/// File names may hold anything; a message stays one line.
std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 32 || c == 127; }, ' ');
  return text;
}

/// Options that may be given: the program's own and those of the subcommand in use.
std::vector<std::string> long_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  for (const CLI::App* subcommand : app.get_subcommands())
    for (const std::string& name : long_names(*subcommand)) names.push_back(name);
  return names;
}

template <class Holds>
CLI::Validator number_check(const std::string& expected, Holds holds) {
  return CLI::Validator(
      [=](const std::string& text) {
        double value = 0.0;
        const bool good = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && holds(value);
        return good ? std::string() : "is " + text + ", expected " + expected;
      },
      "", expected);
}

}  // namespace

Program::Program(std::string name, const std::string& purpose)
    : name_(std::move(name)),
      options_(std::make_unique<CLI::App>(purpose, name_)),
      report_(std::make_unique<nlohmann::ordered_json>()),
      progress_(name_) {
  options_->set_version_flag("--version", name_and_version(), "print the version and stop");
  options_->set_help_flag("-h,--help", "print this help and stop");
  options_->add_option("--report", report_path_, "write a machine-readable report here")->type_name("FILE.json");
  options_->get_formatter()->column_width(34);
  options_->footer("Exit codes: 0 good, 1 failed work, 2 wrong usage. Output files appear whole or not at all.");
  (*report_)["program"] = name_;
  (*report_)["version"] = LIMBER_VERSION_STRING;
}

Program::~Program() = default;

std::string Program::name_and_version() const { return name_ + " " LIMBER_VERSION_STRING; }

int Program::run(int argc, const char* const* argv, const std::function<void()>& work) {
  // A file size limit then shows as a failed write, with its reason, instead of ending the program half way.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    options_->parse(argc, argv);
    work();
    finish();
    return kGood;
  } catch (const CLI::ParseError& e) {
    return refuse_usage(e);
  } catch (const InvalidArgument& e) {
    return fail(kWrongUsage, e.what());
  } catch (const std::bad_alloc&) {
    return fail(kFailed, "not enough memory");
  } catch (const std::exception& e) {
    return fail(kFailed, e.what());
  }
}

void Program::print(std::string_view text) {
  progress_.clear();
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fflush(stdout);  // finish() looks whether it failed
}

void Program::write_file(const std::filesystem::path& path, std::string_view bytes) {
  std::error_code ignored;
  for (const auto& input : input_paths_)
    if (std::filesystem::equivalent(path, input, ignored))
      throw InvalidArgument("the output \"" + path.string() + "\" is an input too, expected another name");
  // Absolute first: a relative path whose file does not exist yet would stay relative.
  const auto same = std::filesystem::weakly_canonical(std::filesystem::absolute(path));
  if (std::find(output_paths_.begin(), output_paths_.end(), same) != output_paths_.end())
    throw InvalidArgument("two outputs have the same name \"" + path.string() + "\", expected one name each");
  output_paths_.push_back(same);
  outputs_.add(path, bytes);
}

void Program::finish() {
  if (!report_path_.empty()) {
    (*report_)["warnings"] = warnings_;
    // File names need not be UTF-8; JSON must be.
    write_file(report_path_, report_->dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  }
  progress_.clear();
  if (std::fflush(stdout) != 0 || std::ferror(stdout)) throw InputError("write to standard output: failed");
  outputs_.commit();
  for (const std::string& warning : warnings_)
    std::fprintf(stderr, "%s: warning: %s\n", name_.c_str(), one_line(warning).c_str());
}

int Program::fail(int code, std::string message) {
  progress_.clear();
  std::fprintf(stderr, "%s: %s\n", name_.c_str(), one_line(std::move(message)).c_str());
  return code;
}

int Program::refuse_usage(const CLI::ParseError& error) {
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success))  // --help or --version
    return options_->exit(error);
  std::string message = error.what();
  if (dynamic_cast<const CLI::ExtrasError*>(&error)) {
    const std::string stranger = options_->remaining(true).empty() ? "" : options_->remaining(true).front();
    message = "\"" + stranger + "\" was not expected";
    if (stranger.starts_with("--"))
      message = "the option \"" + stranger + "\" is unknown; did you mean \"" +
                internal::nearest_word(stranger.substr(0, stranger.find('=')), long_names(*options_)) + "\"?";
  }
  return fail(kWrongUsage, message + " (see " + name_ + " --help)");
}

CLI::Validator positive_number() {
  return number_check("a finite number > 0", [](double x) { return x > 0.0; });
}

CLI::Validator non_negative_number() {
  return number_check("a finite number >= 0", [](double x) { return x >= 0.0; });
}

CLI::Validator number_above_one() {
  return number_check("a finite number > 1", [](double x) { return x > 1.0; });
}

CLI::Validator proper_fraction() {
  return number_check("a number > 0 and < 1", [](double x) { return x > 0.0 && x < 1.0; });
}

CLI::Validator number_between(double low, double high) {
  std::ostringstream expected;
  expected << "a number from " << low << " to " << high;
  return number_check(expected.str(), [=](double x) { return x >= low && x <= high; });
}

}  // namespace limber::tools
