"""`cosim serve`: the local page, from recordings and a card dropped into a browser to the report of a diagnosis.

One process serves pages on 127.0.0.1 to who has the token; a second one looks at files; a third one diagnoses, one job
at a time. All are of this machine, nothing is sent anywhere, and what was diagnosed is kept as files.

    job       a diagnosis as data: its recordings, its card, how far it is
    store     jobs as folders
    uploads   names and sizes of what is dropped
    looks     what a file or a card holds; runs in a process of its own
    reader    that process
    work      the diagnosis; runs in a process of its own
    queue     that process, one job after the other
    desk      what can be done with a job; knows no HTTP
    guard     token, host, origin, headers
    app       addresses; server  the process that answers them
"""
