# Completion of sstd for fish. Made from its --help by `make man`; do not edit.
complete -c sstd -l config -r -d 'configuration; /etc/sst/sstd.yaml, and conf.d/*.yaml beside it'
complete -c sstd -l check -d 'check the configuration, print its faults, and exit (0: valid, 78: not)'
complete -c sstd -l socket -r -d 'control socket instead of the configuration\'s'
complete -c sstd -s v -l verbose -d 'log more (twice: everything)'
complete -c sstd -l version -d 'print the version'
complete -c sstd -s h -l help -d 'this'
