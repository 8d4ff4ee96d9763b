#include "describe.h"

#include <algorithm>
#include <vector>

namespace supple::tool {
namespace {

std::vector<const CLI::App*> commands_of(const CLI::App& app) { return app.get_subcommands([](const CLI::App*) { return true; }); }

/// "--out", "-h": as they are typed.
std::vector<std::string> spellings_of(const CLI::Option& option) {
  std::vector<std::string> out;
  for (const std::string& name : option.get_lnames()) out.push_back("--" + name);
  for (const std::string& name : option.get_snames()) out.push_back("-" + name);
  return out;
}

bool takes_value(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : " ") + word;
  return out;
}

std::string options_of(const CLI::App& command) {
  std::vector<std::string> words;
  for (const CLI::Option* option : command.get_options()) {
    for (std::string& word : spellings_of(*option)) words.push_back(std::move(word));
  }
  return joined(words);
}

/// Within single quotes of a shell.
std::string quoted(std::string text) {
  for (std::size_t at = text.find('\''); at != std::string::npos; at = text.find('\'', at + 4)) text.replace(at, 1, "'\\''");
  return '\'' + text + '\'';
}

/// Text of a man page: nothing in it is a request.
std::string roff(const std::string& text) {
  std::string out;
  bool at_begin = true;
  for (const char c : text) {
    if (at_begin && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
    at_begin = c == '\n';
  }
  return out;
}

void write_options(const CLI::App& command, std::string& out) {
  for (const CLI::Option* option : command.get_options()) {
    std::string names = joined(spellings_of(*option));
    if (names.empty()) names = option->get_name(true);
    out += ".TP\n.B " + roff(names) + (takes_value(*option) && option->nonpositional() ? " \\fIVALUE\\fR" : "") + '\n' + roff(option->get_description()) + '\n';
  }
}

}  // namespace

std::string bash_completion(const CLI::App& app) {
  std::string names, cases;
  for (const CLI::App* command : commands_of(app)) {
    names += (names.empty() ? "" : " ") + command->get_name();
    cases += "    " + command->get_name() + ") words=" + quoted(options_of(*command)) + " ;;\n";
  }
  return "# Completion of supple for bash.\n"
         "_supple() {\n"
         "  local word=${COMP_WORDS[COMP_CWORD]} words=''\n"
         "  if ((COMP_CWORD == 1)); then\n"
         "    mapfile -t COMPREPLY < <(compgen -W " + quoted(names + ' ' + options_of(app)) + " -- \"$word\")\n"
         "    return\n"
         "  fi\n"
         "  case ${COMP_WORDS[1]} in\n" + cases +
         "  esac\n"
         "  if [[ $word == -* ]]; then\n"
         "    mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$word\")\n"
         "  else\n"
         "    mapfile -t COMPREPLY < <(compgen -f -- \"$word\")\n"
         "  fi\n"
         "}\n"
         "complete -o filenames -F _supple supple\n";
}

std::string zsh_completion(const CLI::App& app) {
  const auto plain = [](std::string text) {  // of a description: signs that _arguments reads are left out
    std::erase_if(text, [](char c) { return c == '[' || c == ']' || c == ':' || c == '\n'; });
    return text;
  };
  std::string names, cases;
  for (const CLI::App* command : commands_of(app)) {
    names += "    " + quoted(command->get_name() + ':' + plain(command->get_description())) + '\n';
    cases += "    " + command->get_name() + ") _arguments";
    for (const CLI::Option* option : command->get_options()) {
      for (const std::string& name : spellings_of(*option)) {
        cases += ' ' + quoted(name + '[' + plain(option->get_description()) + ']' + (takes_value(*option) ? ":value:_files" : ""));
      }
    }
    cases += " '*:file:_files' ;;\n";
  }
  return "#compdef supple\n"
         "local -a commands\n"
         "commands=(\n" + names +
         ")\n"
         "if ((CURRENT == 2)); then\n"
         "  _describe command commands\n"
         "else\n"
         "  case ${words[2]} in\n" + cases +
         "  esac\n"
         "fi\n";
}

std::string man_page(const CLI::App& app, const std::string& version) {
  std::string out = ".TH SUPPLE 1 \"\" \"supple " + version + "\"\n.SH NAME\nsupple \\- simulate and draw deformable bodies" +
                    "\n.SH SYNOPSIS\n.B supple\n.I COMMAND\n[options]\n.SH COMMANDS\n";
  for (const CLI::App* command : commands_of(app)) {
    out += ".SS supple " + roff(command->get_name()) + '\n' + roff(command->get_description()) + ".\n";
    write_options(*command, out);
    if (!command->get_footer().empty()) out += ".PP\n.nf\n" + roff(command->get_footer()) + "\n.fi\n";
  }
  return out + ".SH EXIT STATUS\n.nf\n" + roff(app.get_footer()) + "\n.fi\n";
}

}  // namespace supple::tool
