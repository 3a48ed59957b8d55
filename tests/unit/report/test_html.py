"""What stands between backticks in a sentence is code on a page, and nothing in it is markup."""

from cpfls_cli.report.figure_tables import with_code


def test_commands_and_keys_are_code_and_the_rest_is_escaped():
    said = "`cpfls gap A<B` looks for it, p < 1, and a lone ` stays"
    assert with_code(said) == "<code>cpfls gap A&lt;B</code> looks for it, p &lt; 1, and a lone ` stays"
